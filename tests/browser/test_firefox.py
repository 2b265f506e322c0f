"""The built book in Debian's Firefox: each page opens, and each kind of figure, gate and button answers there, too."""

import pytest

from coursekit.teaching.touch import SCENES, guess_ellipse, guess_point, touch
from tests.browser.conftest import HTML
from tests.browser.firefox import PROGRAM, Firefox
from tests.browser.test_explorers import PICTURE
from tests.browser.test_pages import LOADED, PAGES, every_page

pytestmark = pytest.mark.browser


@pytest.fixture(scope="session")
def browser_beside(tmp_path_factory):
    if PROGRAM is None:
        pytest.skip("there is no Firefox here; Debian has it as firefox-esr")
    browser = Firefox(tmp_path_factory.mktemp("firefox"))
    yield browser
    browser.close()


# What Firefox says of a formula that it draws while the page is half there; WHOLE counts when all of it is.
EARLY = "javascript: Invalid markup: Incorrect number of children for"


@pytest.fixture
def firefox(browser_beside):
    """The one Firefox, that has nothing to complain of when the test is over."""
    yield browser_beside
    browser_beside.open("about:blank")
    complaints, browser_beside.complaints = browser_beside.complaints, []
    assert [c for c in complaints if not c.startswith(EARLY)] == []


def a_page_with(kind):
    """The page of the book with the most elements of this class."""
    count = {name: (HTML / name).read_text(encoding="utf-8").count(f'class="{kind}"') for name in PAGES}
    name = max(count, key=count.get)
    return name if count[name] else pytest.fail(f"no page of the book has a {kind}")


MIDDLE = """(selector, k = 0) => {
  const element = document.querySelectorAll(selector)[k];
  element.scrollIntoView({ block: "center", behavior: "instant" });
  const box = element.getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2];
}"""
FOCUS = "(selector, k = 0) => document.querySelectorAll(selector)[k].focus()"
TEXT = "(selector, k = 0) => document.querySelectorAll(selector)[k].textContent"


def click(firefox, selector, k=0):
    firefox.drag(firefox.ask(MIDDLE, selector, k))


WHOLE = r"""() => {
  const maths = [...document.querySelectorAll(".math")];
  const needed = { mfrac: 2, mroot: 2, msub: 2, msup: 2, munder: 2, mover: 2, msubsup: 3, munderover: 3 };
  return {
    children: [...document.querySelectorAll(Object.keys(needed))]
      .filter((e) => e.childElementCount !== needed[e.localName]).map((e) => e.outerHTML),
    wider: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    undrawn: maths.filter((m) => !m.querySelector("mjx-container svg")?.getBoundingClientRect().width
      && m.checkVisibility()).map((m) => m.textContent),
    source: document.querySelector("main").innerText.match(/\\\(|\\\[|\\begin\{/g),
    blank: [...document.images].filter((i) => !i.naturalWidth).map((i) => i.src.slice(-60)),
  };
}"""


@every_page
def test_a_page_opens_without_a_complaint_and_its_formulas_are_typeset(firefox, site, name):
    firefox.open(f"{site}/{name}", width=390, height=844)
    firefox.ask(LOADED)
    assert firefox.ask(WHOLE) == {"children": [], "wider": 0, "undrawn": [], "source": None, "blank": []}


@pytest.mark.parametrize("where", ["site", "disk"])
def test_an_arrow_key_on_a_slider_changes_the_picture(firefox, site, where):
    name = a_page_with("explorer")
    firefox.open(f"{site}/{name}" if where == "site" else (HTML / name).as_uri())
    slider, image = ".explorer input[type=range]", "document.querySelector('.explorer:has(input[type=range]) img')"

    def picture():
        firefox.wait(f"() => {image}.complete && {image}.currentSrc === {image}.src")
        return firefox.ask(f"() => ({PICTURE})({image})")

    firefox.ask(FOCUS, slider)
    firefox.press("Home")
    before = picture()
    firefox.press("ArrowRight")
    after = picture()
    assert after["frame"] != before["frame"] and after["words"] != before["words"]
    assert after["pixels"] != before["pixels"] or where == "disk"
    firefox.press("ArrowLeft")
    assert picture() == before


def test_a_picture_that_has_come_is_not_dimmed(firefox, site):
    firefox.open(f"{site}/{a_page_with('explorer')}")
    count = firefox.ask("() => document.querySelectorAll('.explorer').length")
    assert count
    for k in range(count):
        firefox.ask(MIDDLE, ".explorer img", k)
        clear = "(k) => getComputedStyle(document.querySelectorAll('.explorer img')[k]).opacity === '1'"
        firefox.wait(clear, k)
        assert firefox.ask("(k) => document.querySelectorAll('.explorer img')[k].complete", k)


CLOUD = [[-1.0, 0.2], [0.5, -0.4], [1.1, 0.3]]
FIGURES = {scene: touch(scene, alt="A figure that is touched.") for scene in SCENES} | {
    "point": guess_point("Where does it stand?", [1.0, 0.0], extent=(-6, 6, -4, 4)),
    "ellipse": guess_ellipse("Where will they stop?", CLOUD, extent=(-6, 6, -4, 4)),
}
HANDLES = "() => [...document.querySelectorAll('.touch-handle')].map((h) => h.getAttribute('aria-valuetext'))"


@pytest.mark.parametrize("kind", FIGURES)
def test_every_handle_of_a_touched_figure_moves_by_arrow_key_and_by_mouse(firefox, tmp_path, kind):
    html = FIGURES[kind]._repr_html_()
    (tmp_path / "touch.html").write_text(f"<!doctype html><meta charset=utf-8><body>{html}", encoding="utf-8")
    firefox.open((tmp_path / "touch.html").as_uri())
    start = firefox.ask(HANDLES)
    assert start
    for k, told in enumerate(start):
        firefox.ask(FOCUS, ".touch-handle", k)
        firefox.press("Shift+ArrowUp", "Shift+ArrowLeft")
        pressed = firefox.ask(HANDLES)[k]
        firefox.drag(firefox.ask(MIDDLE, ".touch-grip", k), (50, 35))
        dragged = firefox.ask(HANDLES)[k]
        assert told != pressed != dragged


def test_a_touched_figure_of_the_book_moves_under_its_policy(firefox, site):
    firefox.open(f"{site}/{a_page_with('touch')}")
    told = firefox.ask(HANDLES)[0]
    firefox.drag(firefox.ask(MIDDLE, ".touch-grip"), (30, -20))
    assert firefox.ask(HANDLES)[0] != told


def test_a_guess_unlocks_the_truth_and_a_reload_keeps_it(firefox, site):
    address = f"{site}/{a_page_with('guess')}"
    firefox.open(address)
    assert firefox.ask(TEXT, ".guess-verdict") == ""
    firefox.ask(FOCUS, ".guess input")
    firefox.press("1")
    if firefox.ask("() => document.querySelector('.guess').querySelectorAll('input').length") > 1:
        firefox.press("Tab", "2")
    firefox.press("Enter")
    said = firefox.ask(TEXT, ".guess-verdict")
    assert said.startswith("You said 1") and "The truth is" in said
    assert firefox.ask("() => document.activeElement.className") == "guess-again"
    firefox.open(address)
    assert firefox.ask(TEXT, ".guess-verdict") == said
    click(firefox, ".guess-again")
    assert firefox.ask(TEXT, ".guess-verdict") == ""


@pytest.mark.parametrize("how", ["mouse", "Enter"])
def test_text_sets_a_figure_and_reads_from_it(firefox, site, how):
    firefox.open(f"{site}/{a_page_with('explorer-set')}")
    seen = """() => {
      const phrase = document.querySelector(".explorer-set");
      const explorer = document.querySelector(`.explorer[data-explorer="${phrase.dataset.sets}"]`);
      const names = [...explorer.querySelectorAll(".explorer-control")].map((control) => control.dataset.name);
      const at = Object.fromEntries(explorer.at().map((position, i) => [names[i], position]));
      return [JSON.parse(phrase.dataset.positions), at, explorer.querySelector("img").alt];
    }"""
    wanted, _, before = firefox.ask(seen)
    if how == "mouse":
        click(firefox, ".explorer-set")
    else:
        firefox.ask(FOCUS, ".explorer-set")
        firefox.press("Enter")
    _, at, after = firefox.ask(seen)
    assert wanted.items() <= at.items() and after != before


def test_the_reader_may_choose_the_dark(firefox, site):
    firefox.open(f"{site}/index.html")
    background = "() => getComputedStyle(document.body).backgroundColor"
    light = firefox.ask(background)
    click(firefox, ".theme-switch-button")
    click(firefox, ".theme-change-button[data-mode=dark]")
    assert firefox.ask("() => document.documentElement.dataset.theme") == "dark"
    assert firefox.ask(background) != light
    firefox.open(f"{site}/notation.html")
    assert firefox.ask("() => document.documentElement.dataset.theme") == "dark", "the choice is forgotten"
    firefox.ask("() => localStorage.clear()")


def test_search_finds_a_word_and_leads_to_it(firefox, site):
    firefox.open(f"{site}/index.html")
    firefox.press("Control+k")
    firefox.wait("() => document.activeElement.matches('#pst-search-dialog input[type=search]')")
    firefox.press(*"kalman", "Enter")
    firefox.wait("() => document.querySelector('#search-results li a') && document.readyState === 'complete'")
    click(firefox, "#search-results li a")
    there = "!location.href.includes('search.html') && document.querySelector('main')?.innerText.toLowerCase()"
    firefox.wait(f"() => {there}.includes('kalman')")
