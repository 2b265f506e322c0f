"""The reference pages of the book: made from the package, the labs and the failures, so that none lags behind."""

import json
import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from docutils import nodes

import coursekit
from coursekit.teaching import failures
from tests import notebooks
from tests.test_docstrings import NAMES

sys.path.insert(0, str(Path(__file__).parent.parent / "book"))
sys.path.insert(0, str(Path(__file__).parent.parent / "book" / "_ext"))
import docstrings
import terms
from reference import api, course_map, formulas, gallery, limits, pictures, speed

ROOT = Path(__file__).parent.parent
LABS = sorted([*notebooks.NOTEBOOKS, *notebooks.OPTIONAL])
GLOSSARY = (ROOT / "book" / "glossary.md").read_text(encoding="utf-8")


# --- the package ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def package():
    return api.pages(LABS)


@pytest.mark.parametrize("name", NAMES)
def test_each_name_of_the_contract_has_one_entry(package, name):
    room, name = name.split(".")
    thing = getattr(getattr(coursekit, room), name)
    entry = re.compile(rf":: {re.escape(thing.__module__)}\.{re.escape(thing.__qualname__)}$", re.M)
    assert sum(len(entry.findall(page)) for page in package.values()) == 1


def test_an_entry_names_the_labs_whose_code_calls_it(package):
    entry = package["api/particles.md"].partition("effective_sample_size\n")[2].partition("..")[0]
    assert "/notebooks/07_particle_filter" in entry and "/notebooks/01" not in entry


def test_a_lab_uses_what_its_code_names_and_not_what_its_prose_does(tmp_path):
    code = "from coursekit import ekf\nfrom coursekit.gaussian import Gaussian\nekf.predict(None)\nx = Gaussian"
    cells = [nbformat.v4.new_code_cell(code), nbformat.v4.new_markdown_cell("ekf.correct")]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "04_x.ipynb")
    used = api.uses(tmp_path / "04_x.ipynb")
    assert {id(coursekit.ekf.predict), id(coursekit.Gaussian)} <= used
    assert id(coursekit.ekf.correct) not in used


def test_a_docstring_becomes_lists_and_its_stars_stay_letters():
    text = (
        "All *of* a*b.\n\nParameters\n----------\ndt : seconds,\n    > 0.\nx, y : metres.   z : more.\n\n>>> 2 * 3\n6"
    )
    assert docstrings.restructured(text).splitlines() == [
        r"All *of* a\*b.", "", "**Parameters**", "", "- **dt**: seconds, > 0.", "- **x, y**: metres.",
        "- **z**: more.", "", ">>> 2 * 3", "6",
    ]  # fmt: skip


# --- failures -------------------------------------------------------------------------------------------------


def test_each_failure_has_a_picture_with_a_caption_and_no_picture_is_left_over():
    names = set(failures.gallery())
    for name in names:
        assert len(pictures.of(name)[1].split()) > 8
    files = (ROOT / "book" / "reference" / "pictures").glob("lab*.py")
    drawn = {f"{p.stem}.{f}" for p in files for f in re.findall(r"^def ([a-z]\w*)\(\) -> Figure", p.read_text(), re.M)}
    assert drawn == names
    with pytest.raises(LookupError, match=r"lab04\.nothing: expected a function"):
        pictures.of("lab04.nothing")


def test_a_failure_has_its_page_which_names_its_source_and_its_check(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "drawn", lambda name, cache, digest: name.encode())
    made = gallery.pages(LABS, tmp_path)
    for name, failure in failures.gallery().items():
        page = made[f"failures/{name.split('.')[0]}.md"]
        assert f"(failure-{name.replace('.', '-')})=" in page and failure.check.__name__ in page
        assert made[f"failures/{name}.webp"] == name.encode()


def test_a_picture_is_drawn_once_and_anew_when_the_code_has_changed(tmp_path, monkeypatch):
    name = "lab09.nine_equal_numbers"
    first = gallery.drawn(name, tmp_path, "a")
    with monkeypatch.context() as patch:
        patch.setattr(pictures, "of", lambda name: pytest.fail("it was drawn again"))
        assert gallery.drawn(name, tmp_path, "a") == first
    gallery.drawn(name, tmp_path, "b")
    assert [p.name for p in tmp_path.iterdir()] == [f"{name}-b.webp"]


# --- glossary -------------------------------------------------------------------------------------------------


def test_the_glossary_is_in_order_and_has_a_meaning_for_each_term():
    meanings = terms.definitions(GLOSSARY)
    assert 60 <= len(set(meanings.values())) <= 110
    assert all(words.endswith(".") and "](" not in words for words in meanings.values())
    heads = re.findall(r"(?:^|\n)\n?(\S[^\n]*)(?:\n\S[^\n]*)*\n  ", GLOSSARY.partition("{glossary}")[2])
    assert heads == sorted(heads, key=str.lower)


def test_the_first_use_of_a_term_in_a_part_is_linked_and_nothing_else():
    def part(*words):
        return nodes.section("", nodes.title("", "Innovation"), *(nodes.paragraph("", "", w) for w in words))

    code = nodes.literal("", "innovation")
    first = part(nodes.Text("Innovations, innovation."), code)
    second = part(nodes.Text("NIS, not nis; innovational."))
    page = nodes.section("", nodes.title("", "Lab"), first, second)
    terms.link(page, {"innovation": "The surprise.", "NIS": "Its square."}, {"innovation": "g#i", "NIS": "g#n"})
    links = [(r.astext(), r["refuri"], r["reftitle"]) for r in page.findall(nodes.reference)]
    assert links == [("Innovations", "g#i", "The surprise."), ("NIS", "g#n", "Its square.")]


def test_words_that_talk_to_a_figure_hold_no_link_to_the_glossary():
    page, says = nodes.section("", nodes.title("", "Lab")), nodes.raw("", '<says data-link="#read:a?b">', format="html")
    told = nodes.paragraph(
        "", "", nodes.Text("It is "), says, nodes.Text("a banana"), nodes.raw("", "</says>", format="html")
    )
    plain = nodes.paragraph("", "", nodes.Text("Like a banana."))
    page += nodes.section("", nodes.title("", "Part"), told, plain)
    terms.link(page, {"banana": "Bent."}, {"banana": "g#b"})
    assert [link.parent for link in page.findall(nodes.reference)] == [plain]


@pytest.mark.parametrize("path", LABS, ids=lambda p: p.stem)
def test_a_lab_uses_terms_of_the_glossary(path):
    assert (
        len({found[0].lower() for found in terms.pattern(terms.definitions(GLOSSARY)).finditer(formulas.text(path))})
        > 5
    )


# --- formulas, map, speed -------------------------------------------------------------------------------------


def test_the_formula_sheet_has_every_lab_and_every_equation_that_its_tables_name():
    (page,) = formulas.pages(LABS).values()
    for path in notebooks.NOTEBOOKS:
        assert f"[Lab {api.lab_number(path)}](notebooks/{path.name})" in page
        assert len(formulas.rows(formulas.text(path))) >= 4
    assert r"x' &= x + \Delta c" in page
    with pytest.raises(ValueError, match="eq-none"):
        formulas.shown("{eq}`eq-none`", "no equation")


def test_an_arrow_of_the_map_is_left_out_when_a_longer_way_says_the_same():
    graph = {"0": set(), "1": {"0"}, "2": {"0", "1"}, "3": {"2", "0"}}
    assert course_map.reduced(graph) == {"0": set(), "1": {"0"}, "2": {"1"}, "3": {"2"}}
    assert course_map.levels(graph) == {"0": 0, "1": 1, "2": 2, "3": 3}


def test_the_map_shows_each_lab_with_its_minutes_and_all_but_the_first_need_another():
    drawing, table = course_map.drawing(LABS), course_map.table(LABS)
    for path in notebooks.NOTEBOOKS:
        assert f'href="notebooks/{path.stem}.html"' in drawing and path.name in table
        needed = course_map.needs(formulas.text(path))
        assert bool(needed) == (api.lab_number(path) != "0")
        assert all(int(lab) < int(api.lab_number(path)) for lab in needed)


ROW = {
    "benchmark": "EKF", "row": "one step", "unit": "µs", "ours": 20.0, "peer": 50.0, "peer_name": "filterpy",
    "peer_version": "1.4.5", "ratio": 2.5, "spread": [2.3, 2.8], "rounds": 200, "threads": 1, "date": "2030-01-31",
    "commit": "0123456789abcdef", "machine": "a desk",
}  # fmt: skip


def test_a_stored_result_is_shown_with_its_spread_and_its_commit(tmp_path):
    (tmp_path / "ekf.json").write_text(json.dumps([ROW]))
    table = speed.table(speed.read(tmp_path))
    assert "| one step | 20 µs | 50 µs (filterpy 1.4.5) | 2.50 (2.30 to 2.80) | 200 |" in table
    assert "commit `0123456789`" in table


def test_a_result_that_lacks_a_field_is_refused_and_none_at_all_is_said(tmp_path, monkeypatch):
    (tmp_path / "ekf.json").write_text(json.dumps([ROW | {"rounds": "many"}]))
    with pytest.raises(ValueError, match=r"ekf\.json: rounds: expected"):
        speed.read(tmp_path)
    monkeypatch.setattr(speed, "read", lambda: [])
    assert "No result is stored" in speed.pages()["how_fast.md"]


def test_a_figure_without_a_peer_is_shown_with_its_own_spread(tmp_path):
    alone = dict.fromkeys(("peer", "peer_name", "peer_version", "ratio")) | {"spread": [19.0, 24.0]}
    (tmp_path / "ekf.json").write_text(json.dumps([ROW | alone]))
    assert "| one step | 20 µs (19 to 24) |  |  | 200 |" in speed.table(speed.read(tmp_path))
    assert "| one step | 12,345 µs (19 to 24) |" in speed.table([ROW | alone | {"ours": 12345.0}])


def test_jobs_with_one_limit_share_its_sentence(monkeypatch):
    monkeypatch.setattr(limits, "LIMITS", {"EKF": {"one": "Calls.", "one step of many": "Memory."}})
    jobs = ["one step", "one leap (wanted: 2 ms)", "one step of many", "none"]
    table = speed.table([ROW | {"row": job} for job in jobs])
    assert "- *one …*: Calls.\n- *one step of many*: Memory.\n\nMeasured" in table


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """What one script stores, with as few rounds as can be."""
    path = tmp_path_factory.mktemp("results") / "made" / "camera.json"
    command = [sys.executable, str(ROOT / "benchmarks" / "camera.py"), "--rounds", "2", "--json", str(path)]
    subprocess.run(command, check=True, capture_output=True, timeout=300, cwd=path.parents[1])
    return speed.read(path.parent)


def test_what_a_benchmark_stores_has_the_fields_and_the_page_shows_it(measured, monkeypatch):
    assert len(measured) == 3 and all(set(row) == set(speed.FIELDS) for row in measured)
    assert all(row["rounds"] == 2 and row["ours"] > 0 and row["peer"] is None for row in measured)
    monkeypatch.setattr(speed, "read", lambda: measured)
    page = speed.pages()["how_fast.md"]
    assert "No result is stored" not in page
    assert all(f"| {row['row']} | {row['ours']:.3g} ms (" in page for row in measured)


def test_every_job_that_is_stored_has_a_sentence_on_its_limit(measured):
    rows = measured + speed.read()
    assert not {(row["benchmark"], row["row"]) for row in rows if not limits.limit(row["benchmark"], row["row"])}
