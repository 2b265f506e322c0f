"""A page of the built book as paper shows it, and two chapters printed."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.browser.conftest import HTML

sys.path.insert(0, str(Path(__file__).parents[2] / "book"))
sys.path.insert(0, str(Path(__file__).parents[2] / "book" / "_ext"))
import pdf

pytestmark = pytest.mark.browser
SCRIPT = (Path(pdf.__file__).parent / "print" / "chapter.js").read_text(encoding="utf-8")
TALKING = [p for p in HTML.glob("notebooks/*.html") if "data-sets=" in p.read_text(encoding="utf-8")]


@pytest.fixture
def lab(page, site):
    """The lightest lab whose text sets an explorer: the tab in which it stands, and what paper shows of it."""
    name = min(TALKING, key=lambda p: p.stat().st_size).relative_to(HTML).as_posix()
    page.goto(f"{site}/{name}", wait_until="load")
    page.evaluate(pdf.READY)
    about = {"prefix": "lab", "site": f"{site}/", "online": "https://somewhere/"}
    about["chapters"] = {f"{site}/{name}": "lab", f"{site}/notation.html": "notation"}
    paper = page.evaluate(SCRIPT, about)
    assert page.complaints == []
    return page, paper


def ask(page, paper, question):
    page.evaluate("(html) => { window.paper = new DOMParser().parseFromString(html, 'text/html'); }", paper["html"])
    return page.evaluate(question)


def test_an_explorer_is_three_frames_that_differ_and_one_is_what_the_text_sets(lab):
    page, paper = lab
    explorers = page.locator(".explorer").count()
    frames = ask(
        page,
        paper,
        "() => [...paper.querySelectorAll('.frames')].map(f => [...f.querySelectorAll('img')].map(i => i.alt))",
    )
    assert len(frames) == explorers > 0
    assert all(2 <= len(shown) == len(set(shown)) <= 3 for shown in frames)
    page.locator(".explorer-set").first.click()
    name = page.locator(".explorer-set").first.get_attribute("data-sets")
    set_by_the_text = page.locator(f'.explorer[data-explorer="{name}"] img').get_attribute("alt")
    assert set_by_the_text in [words for shown in frames for words in shown]
    links = ask(page, paper, "() => [...paper.querySelectorAll('.frames p a')].map(a => a.href)")
    assert len(links) == explorers and all(link.startswith("https://somewhere/notebooks/") for link in links)


def test_paper_has_open_folds_no_controls_and_links_that_lead_somewhere_in_it(lab):
    page, paper = lab
    unwanted = "() => paper.querySelectorAll('details:not([open]), script, form, button, input').length"
    assert ask(page, paper, unwanted) == 0
    assert ask(page, paper, "() => paper.querySelectorAll('mjx-container').length") > 10 and paper["wrong"] == []
    assert all(h["id"] == "lab" or h["id"].startswith("lab--") for h in paper["headings"])
    lost = """() => [...paper.querySelectorAll('a[href^="#lab"], use')]
        .map(a => a.getAttribute('href') ?? a.getAttribute('xlink:href'))
        .filter(href => !paper.getElementById(href.slice(1)))"""
    assert ask(page, paper, lost) == []


def test_the_pdf_has_an_outline_page_numbers_and_one_file_for_one_commit(tmp_path):
    pypdf = pytest.importorskip("pypdf")
    chapters = ["notation", "bibliography"]
    files = [tmp_path / "a.pdf", tmp_path / "b.pdf"]
    make = "import sys, pathlib, pdf; pdf.make(*map(pathlib.Path, sys.argv[1:3]), sys.argv[3:])"
    for file in files:  # in a process of its own: this one has a browser already
        subprocess.run([sys.executable, "-c", make, HTML, file, *chapters], cwd=Path(pdf.__file__).parent, check=True)
    reader = pypdf.PdfReader(files[0])
    assert len(reader.pages) >= 4
    titles = [entry.title for entry in reader.outline if not isinstance(entry, list)]
    assert titles[1:] == ["Contents", "Notation", "Bibliography"]
    contents = reader.pages[1].extract_text()
    last = reader.get_destination_page_number(reader.outline[-1]) + 1
    assert str(last) in contents and "000" not in contents
    assert "Bibliography" in reader.pages[last - 1].extract_text()
    assert files[0].read_bytes() == files[1].read_bytes()
