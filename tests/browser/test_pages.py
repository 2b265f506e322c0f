"""Every page of the built book, wide and on a phone, by day and by night."""

import gzip
import os
import re
from pathlib import Path

import pytest

from tests.browser.conftest import HTML, SCREENS

pytestmark = pytest.mark.browser

# The package's sources, coloured, are one template for all: they are not looked at one by one.
PAGES = sorted(str(p.relative_to(HTML)) for p in HTML.rglob("*.html") if not {"_static", "_modules"} & set(p.parts))
WITH_SLIDERS = [p for p in PAGES if 'class="explorer"' in (HTML / p).read_text(encoding="utf-8")]
# Made by one template: the first of them, and the one that lists them, are looked at each time.
ALIKE = [p for kind in ("api/", "failures/") for p in [n for n in PAGES if n.startswith(kind) and "index" not in n][1:]]
every_page = pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in ALIKE else ()) for n in PAGES]
)
every_page_with_sliders = pytest.mark.parametrize("name", WITH_SLIDERS)

LOADED = """async () => {
  document.querySelectorAll("img[loading=lazy]").forEach((image) => { image.loading = "eager"; });
  await Promise.all([...document.images].map((image) => image.decode().catch(() => {})));
  if (window.MathJax) await window.MathJax.startup.promise;
}"""

# Text whose colour stands out too little from what is behind it (WCAG's ratio).
FAINT = """(least) => {
  const channel = (v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const parse = (text) => { const n = text.match(/[\\d.]+/g).map(Number); return n.length > 3 ? n : [...n, 1]; };
  const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
  const over = (top, under) => [0, 1, 2].map((i) => top[i] * top[3] + under[i] * (1 - top[3]));
  const behind = (e) => {
    const layers = [];
    for (; e; e = e.parentElement) {
      const colour = parse(getComputedStyle(e).backgroundColor);
      if (colour[3] > 0) layers.push(colour);
      if (colour[3] === 1) break;
    }
    return layers.reverse().reduce((under, layer) => over(layer, under), [255, 255, 255]);
  };
  const faint = new Set();
  const walker = document.createTreeWalker(document.querySelector("article") ?? document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const e = walker.currentNode.parentElement, words = walker.currentNode.textContent.trim();
    if (!words || !e.checkVisibility({ opacityProperty: true, visibilityProperty: true })) continue;
    if (e.closest("script, style, svg, mjx-container, .headerlink, button, kbd, [class*=kbd], noscript")) continue;
    const under = behind(e), colour = over(parse(getComputedStyle(e).color), under);
    const [dark, bright] = [light(colour), light(under)].sort((a, b) => a - b);
    const ratio = (bright + 0.05) / (dark + 0.05);
    if (ratio < least) faint.add(`${words.slice(0, 40)} (${e.className || e.tagName}, ${ratio.toFixed(1)})`);
  }
  return [...faint];
}"""

# Pictures whose width and height on the page are not in the proportion in which they were drawn.
SQUEEZED = """[...document.querySelectorAll("article img")].filter((i) => i.clientHeight
  && getComputedStyle(i).objectFit === "fill"
  && Math.abs(i.clientWidth * i.naturalHeight / (i.clientHeight * i.naturalWidth) - 1) > 0.02)
  .map((i) => `${i.alt.slice(0, 40)}: ${i.clientWidth} x ${i.clientHeight}`)"""
# Boxes that stay light at night, with drawings in them that are made for a dark page.
PALE = """[...document.querySelectorAll("article div")].filter((e) => {
  const [r, g, b, a = 1] = getComputedStyle(e).backgroundColor.match(/[\\d.]+/g).map(Number);
  return a === 1 && (r + g + b) / 3 > 150 && e.clientHeight; }).map((e) => e.className + e.innerText.slice(0, 40))"""
# Text that begins a line with a full stop or a comma, because what stands before it is a box.
ORPHANS = r"""() => {
  const found = [], range = document.createRange();
  const walker = document.createTreeWalker(document.querySelector("article") ?? document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const text = walker.currentNode, box = text.previousSibling;
    if (!/^[.,;:!?)]/.test(text.data) || !box?.matches?.(".math, .symbol")) continue;
    range.setStart(text, 0); range.setEnd(text, 1);
    const formula = box.matches(".math") ? box : box.querySelector(".math");
    const sign = range.getBoundingClientRect(), before = formula.getBoundingClientRect();
    if (sign.height && sign.left < before.right - 2) found.push(text.parentElement.innerText.slice(0, 40));
  }
  return found;
}"""


def look(page, address, screen, scheme):
    width, height = SCREENS[screen]
    page.set_viewport_size({"width": width, "height": height})
    page.emulate_media(color_scheme=scheme)
    page.goto(address, wait_until="load")
    page.evaluate(LOADED)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("screen", SCREENS)
@every_page
def test_a_page_is_whole(page, site, name, screen, scheme):
    look(page, f"{site}/{name}", screen, scheme)
    # Folded parts belong to the page too.
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    if folder := os.environ.get("COURSEKIT_SCREENS"):
        page.screenshot(path=Path(folder) / f"{name.replace('/', '-')[:-5]}-{screen}-{scheme}.png")
    assert page.complaints == []
    overflow = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert overflow <= 0, f"{overflow} px wider than the screen"
    images = page.evaluate("[...document.images].map((i) => [i.alt, i.naturalWidth, i.currentSrc.slice(-60)])")
    assert [source for alt, width, source in images if not alt.strip() or width == 0] == []
    assert page.evaluate(SQUEEZED) == []
    assert page.evaluate(ORPHANS) == []
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    brightness = sum(map(int, re.findall(r"\d+", background)[:3])) / 3
    assert brightness > 200 if scheme == "light" else brightness < 60
    assert scheme == "light" or page.evaluate(PALE) == []
    assert page.evaluate(FAINT, 4.0) == []


@every_page
def test_equations_are_drawn_and_none_is_left_as_text_or_error(page, site, name):
    look(page, f"{site}/{name}", "wide", "light")
    assert page.evaluate(r"document.querySelector('main').innerText.match(/\\\(|\\\[|\\begin\{/g)") is None
    undrawn = "[...document.querySelectorAll('.math')].filter((m) => !m.querySelector('mjx-container')).length"
    assert page.evaluate(undrawn) == 0
    assert page.evaluate("document.querySelectorAll('[data-mjx-error], mjx-merror').length") == 0
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    cut = "[...document.querySelectorAll('div.math mjx-container')].filter((e) => e.scrollWidth > e.clientWidth + 1)"
    assert page.evaluate(f"{cut}.map((e) => e.closest('.math').id || e.innerText)") == [], "wider than the column"


@every_page_with_sliders
def test_a_page_with_sliders_is_light(name):
    assert len(gzip.compress((HTML / name).read_bytes(), 6)) < 220_000, "as a server sends it"


@pytest.mark.parametrize("word", ["covariance", "kalman"])
def test_search_finds_a_word_and_leads_to_it(page, site, word):
    page.goto(f"{site}/index.html")
    page.keyboard.press("Control+k")
    page.locator("#pst-search-dialog input[type=search]").fill(word)
    page.keyboard.press("Enter")
    first = page.locator("#search-results li a").first
    first.wait_for()
    page.wait_for_load_state("networkidle")  # the excerpts of the other results are still being fetched
    first.click()
    page.wait_for_load_state("load")
    assert word in page.locator("main").inner_text().lower()
    assert page.complaints == []


def test_the_reader_may_choose_the_dark(page, site):
    look(page, f"{site}/index.html", "wide", "light")
    page.get_by_role("button", name="Color mode").click()
    page.get_by_role("button", name="Dark").click()
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    page.goto(f"{site}/notation.html")
    assert page.evaluate("document.documentElement.dataset.theme") == "dark", "the choice is forgotten"
    page.evaluate("localStorage.clear()")
