"""What no page of the published book may lack: working links, valid HTML, a description, a card, a policy, lightness.

The pages' files are read once; only what a browser alone can tell is asked of one.
"""

import gzip
import re
import shutil
import subprocess
from functools import cache
from html.parser import HTMLParser
from urllib.parse import unquote, urldefrag

import pytest

from tests.browser.conftest import HTML
from tests.browser.test_pages import ALIKE, PAGES, WITH_SLIDERS, every_page, look

pytestmark = pytest.mark.browser
AXE = "axe-core@4.14.1"
QUICK = [p for p in PAGES if p not in ALIKE and (not p.startswith("notebooks/") or "05b" in p) and p != "notation.html"]
EMPTY = {"area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}
PHRASE = {"summary", "span", "p", "h1", "h2", "h3", "h4", "label", "button"}  # which hold no paragraph
LIMIT = 6e6  # bytes of a page and all that it may fetch


class Page(HTMLParser):
    """A page's addresses, ids and metadata, and what is wrong with its elements."""

    def __init__(self, text):
        super().__init__()
        self.addresses, self.ids, self.metas, self.faults, self.open, self.title = [], [], {}, [], [], ""
        self.base = False
        self.feed(text)
        self.faults += [f"<{tag}> is never closed" for tag in self.open if tag not in ("p", "li")]

    def handle_starttag(self, tag, attributes):
        named = dict(attributes)
        names = [name for name, _ in attributes]
        self.faults += [f"<{tag}> has {name} twice" for name in named if names.count(name) > 1]
        if "id" in named:
            self.ids.append(named["id"])
        if tag == "meta":
            self.metas[named.get("name") or named.get("property") or named.get("http-equiv")] = named.get("content")
        self.base |= tag == "base"
        self.addresses += [named[a] for a in ("href", "src") if named.get(a) and tag not in ("base", "use")]
        if tag in ("p", "div", "section", "ul", "table") and self.open and self.open[-1] in PHRASE - {"p"}:
            self.faults.append(f"<{tag}> in <{self.open[-1]}>")
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in EMPTY:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if tag in EMPTY:
            return
        if tag not in self.open:
            self.faults.append(f"</{tag}> closes nothing")
            return
        while self.open.pop() != tag:
            pass

    def handle_data(self, text):
        if self.open and self.open[-1] == "title":
            self.title += text


@cache
def parsed(name):
    return Page((HTML / name).read_text(encoding="utf-8"))


def leads_nowhere(name, address):
    """In words what is wrong with an address in a page, or nothing."""
    path, anchor = urldefrag(address)
    if re.match(r"[a-z]+:", path):
        return None
    file = (HTML / name).parent / unquote(path.split("?")[0]) if path else HTML / name
    if not file.exists():
        return f"{address}: there is no such file"
    target = str(file.resolve().relative_to(HTML))
    if anchor and target in PAGES and unquote(anchor) not in parsed(target).ids:
        return f"{address}: there is no such place"
    return None


def test_no_link_of_the_site_leads_nowhere():
    broken = {(n, leads_nowhere(n, a)) for n in PAGES for a in parsed(n).addresses}
    assert sum(len(parsed(n).addresses) for n in PAGES) > 500
    assert sorted((n, why) for n, why in broken if why) == []


def test_every_page_is_valid_and_no_id_comes_twice():
    faults = [(n, fault) for n in PAGES for fault in parsed(n).faults]
    faults += [(n, f"{i} twice") for n in PAGES for i in set(parsed(n).ids) if parsed(n).ids.count(i) > 1]
    assert faults == []


def test_the_reader_of_html_sees_faults():
    page = Page('<body><summary><p>Show</p></summary><i></div><b class="a" class="b"><section>')
    assert page.faults == [
        "<p> in <summary>", "</div> closes nothing", "<b> has class twice",
        "<body> is never closed", "<i> is never closed", "<b> is never closed", "<section> is never closed",
    ]  # fmt: skip


def test_every_page_has_a_title_of_its_own_a_description_and_a_card():
    titles = [parsed(n).title.strip() for n in PAGES]
    assert len(set(titles)) == len(titles) and all(titles)
    for name in PAGES:
        metas = parsed(name).metas
        assert 20 <= len(metas["description"]) <= 200, name
        assert metas["og:title"] and metas["og:description"] == metas["description"]
        assert (HTML / "_static" / "cards" / metas["og:image"].rsplit("/", 1)[1]).stat().st_size < 150_000


def fetched(name):
    """The files that a page may fetch, itself first: text as a server packs it, pictures as they are; in bytes."""
    text = (HTML / name).read_text(encoding="utf-8")
    addresses = {
        urldefrag(a)[0].split("?")[0]
        for a in re.findall(r'src="([^"]+)"|rel="stylesheet"[^>]*href="([^"]+)"', text)
        for a in a
        if a
    }
    addresses |= set(re.findall(r'<link href="([^"?]+)[^>]*rel="stylesheet"', text))
    addresses |= set(re.findall(r'"((?:\.\./)*_static/explorers/\w+\.webp)"', text))
    files = {(HTML / name).resolve(), *((HTML / name).parent.joinpath(a).resolve() for a in addresses if ":" not in a)}
    packed = (".html", ".css", ".js", ".svg")
    return {f: len(gzip.compress(f.read_bytes(), 6)) if f.suffix in packed else f.stat().st_size for f in files}


def test_every_page_is_light_and_the_lightness_is_printed(capsys):
    weights = {name: fetched(name) for name in PAGES}
    with capsys.disabled():
        print()
        for name, files in weights.items():
            first = sum(size for f, size in files.items() if f.parent.name != "explorers")
            print(f"  {name}: {sum(files.values()) / 1e6:.2f} MB, of them {first / 1e6:.2f} MB before a slider moves")
    assert {name: sum(files.values()) for name, files in weights.items() if sum(files.values()) > LIMIT} == {}


def test_formulas_are_in_the_page_and_no_font_of_icons_is_fetched(page, site):
    if shutil.which("node") is None:
        pytest.skip("without Node.js the reader's browser typesets the formulas")
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    look(page, f"{site}/{WITH_SLIDERS[-1]}", "wide", "dark")
    assert page.locator(".math mjx-container").count() > 20
    assert [a for a in asked if "fontawesome" in a or "tex-svg" in a] == []


@pytest.fixture(scope="module")
def strict(browser):
    """A browser that keeps the pages' policy, which the other tests have to set aside for their own scripts."""
    context = browser.browser.new_context()
    yield context
    context.close()


@every_page
def test_a_page_runs_its_own_scripts_and_nobody_elses(strict, site, name):
    tab, complaints = strict.new_page(), []
    tab.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.goto(f"{site}/{name}", wait_until="load")
    assert complaints == []
    if slider := tab.query_selector(".explorer input[type=range]"):
        assert slider.is_visible(), "its script has not run"
    blocked = """() => new Promise((resolve) => {
      const seen = [];
      document.addEventListener("securitypolicyviolation", (event) => {
        seen.push(event.effectiveDirective);
        if (seen.length === 2) resolve(seen.sort());
      });
      const script = document.createElement("script");
      script.textContent = "window.stranger = true";
      document.body.append(script);
      new Image().src = "http://127.0.0.2:9/pixel.png";
    })"""
    assert tab.evaluate(blocked) == ["img-src", "script-src-elem"]
    assert not tab.evaluate("window.stranger ?? false")
    tab.close()


FOCUSED = """() => {
  const e = document.activeElement;
  if (e === document.body) return null;
  // A whole card is the link; a fold of the sidebar shows as its sign.
  const shown = e.matches(".sd-stretched-link") ? e.closest(".sd-card") : e.querySelector(".toctree-toggle") ?? e;
  const box = shown.getBoundingClientRect(), style = getComputedStyle(shown);
  const ring = style.outlineStyle !== "none" || style.boxShadow !== "none"
    || e.matches("dialog, input, article summary, .btn");
  e.dataset.visited = Number(e.dataset.visited ?? 0) + 1;
  return [e.outerHTML.slice(0, 90), box.width > 0 && box.height > 0, ring, Number(e.dataset.visited)];
}"""


def test_the_keyboard_comes_through_a_whole_page(page, site):
    """Each stop is visible, none is visited twice, and the last one is followed by the browser's own bar."""
    look(page, f"{site}/index.html", "wide", "light")
    stops = []
    for _ in range(300):
        page.keyboard.press("Tab")
        if (stop := page.evaluate(FOCUSED)) is None:
            break
        if stop[3] > 1:
            break
        stops.append(stop)
    kinds = " ".join(html for html, *_ in stops)
    assert len(stops) > 25 and "Skip to main content" in stops[0][0] and "<input" in kinds
    assert [html for html, seen, ring, _ in stops if not seen or not ring] == []
    # A heading's link to itself shows under the mouse alone.
    reached = "[...document.querySelectorAll('article a[href]:not(.headerlink)')].filter((a) => a.checkVisibility())"
    links, visited = page.evaluate(f"[{reached}.length, {reached}.filter((a) => a.dataset.visited).length]")
    assert visited == links


@pytest.fixture(scope="module")
def axe(tmp_path_factory):
    """The script of axe-core, fetched by npm; the tests that need it are skipped where it can't be had."""
    if shutil.which("npm") is None:
        pytest.skip("axe-core comes by npm, and there is none")
    folder = tmp_path_factory.mktemp("axe")
    command = ["npm", "install", "--no-audit", "--no-fund", "--ignore-scripts", "--prefix", str(folder), AXE]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    script = folder / "node_modules" / "axe-core" / "axe.min.js"
    if not script.exists():
        pytest.skip(f"npm could not fetch {AXE}: {done.stderr[-200:]}")
    return script.read_text(encoding="utf-8")


FAULTS = """async () => (await axe.run(document, { resultTypes: ["violations"] })).violations
  .filter((v) => ["serious", "critical"].includes(v.impact))
  .map((v) => `${v.id}: ${v.nodes.slice(0, 3).map((n) => n.target.join(" ")).join(", ")}`)"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in PAGES]
)  # axe looks at a long page for some ten seconds
def test_axe_finds_no_serious_fault(page, site, axe, name, scheme):
    look(page, f"{site}/{name}", "wide", scheme)
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    page.evaluate(axe)
    assert page.evaluate(FAULTS) == []


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("data association", "Which landmark was that?"),
        ("overconfident", "why was it too sure?"),
        ("SLAM", "Lab 5: Localise and map at once"),
        ("NEES", "Does the filter know how wrong it is?"),
    ],
)
def test_the_search_finds_sections_by_the_words_of_readers(page, site, words, expected):
    page.goto(f"{site}/search.html?q={words}")
    page.locator("#search-results li").first.wait_for()
    hits = page.locator("#search-results li").evaluate_all(
        "(l) => l.map((i) => [i.querySelector('a').getAttribute('href'), i.textContent])"
    )
    assert any(expected in text for _, text in hits[:5])
    assert "bibliography.html" not in {urldefrag(href)[0] for href, _ in hits[:10]}
    assert sum("#" in href for href, _ in hits) > len(hits) / 2
    assert [text for _, text in hits if re.search(r"^import |\bnp\.|\.ipynb", text)] == []
    first = page.locator("#search-results a").first
    target = first.get_attribute("href")
    first.click()
    page.wait_for_load_state("load")
    assert page.url.endswith(target) and page.complaints == []
