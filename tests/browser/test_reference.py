"""The reference pages in a browser: what prints on two pages, what is shown, and what leads where."""

import re

import pytest

from coursekit.teaching import failures
from tests.browser.conftest import HTML
from tests.browser.test_pages import LOADED

pytestmark = pytest.mark.browser


def test_the_formula_sheet_prints_on_two_pages_of_a4_and_cuts_no_formula(page, site):
    page.goto(f"{site}/formulas.html", wait_until="load")
    page.evaluate(LOADED)
    printed = page.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 2
    assert b"[0 0 594.96" in printed.replace(b"594.95", b"594.96")
    page.set_viewport_size({"width": 710, "height": 1000})  # A4 without its margins
    page.emulate_media(media="print")
    cut = """[...document.querySelectorAll(".formula-sheet td svg")].filter(
        (s) => s.getBoundingClientRect().right > s.closest("td").getBoundingClientRect().right + 1).length"""
    assert page.evaluate(cut) == 0


def test_each_failure_is_shown_on_its_page(page, site):
    for lab in sorted({name.split(".")[0] for name in failures.gallery()}):
        page.goto(f"{site}/failures/{lab}.html", wait_until="load")
        page.evaluate(LOADED)
        shown = page.evaluate("[...document.querySelectorAll('figure img')].map((i) => [i.currentSrc, i.naturalWidth])")
        wanted = [name for name in failures.gallery() if name.startswith(lab)]
        assert [source.split("/")[-1].removesuffix(".webp") for source, width in shown if width > 400] == wanted
    assert page.complaints == []


def test_every_lab_leads_to_the_glossary_and_each_link_arrives():
    there = set(re.findall(r'id="(term-[^"]+)"', (HTML / "glossary.html").read_text(encoding="utf-8")))
    for lab in (HTML / "notebooks").glob("*.html"):
        led = set(re.findall(r'<a class="term[^>]*glossary\.html#([^"]+)"', lab.read_text(encoding="utf-8")))
        assert len(led) >= 5 and led <= there, lab.name


def test_the_map_leads_to_a_lab_by_keyboard(page, site):
    page.goto(f"{site}/course_map.html", wait_until="load")
    page.locator(".course-map a").first.focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/notebooks/00_the_world.html")
