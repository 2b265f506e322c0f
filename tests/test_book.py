"""The book's workshop, without the book: configuration, running and keeping labs, moving frames, one tiny page."""

import base64
import io
import re
import runpy
import sys
from pathlib import Path

import nbformat
import numpy as np
import pytest
from PIL import Image

from coursekit.explore import sweep
from tests import labs

sys.path.insert(0, str(Path(__file__).parent.parent / "book"))
sys.path.insert(0, str(Path(__file__).parent.parent / "book" / "_ext"))
import build
import cover
import execute
import explorers

BOOK = Path(__file__).parent.parent / "book"
BIBLIOGRAPHY = [BOOK / "references.bib", *sorted((BOOK / "references").glob("*.bib"))]


def code(source, tags=(), **metadata):
    return nbformat.v4.new_code_cell(source, metadata={"tags": list(tags), **metadata})


def prose(source):
    return nbformat.v4.new_markdown_cell(source)


def notebook(*cells):
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    about = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return nbformat.v4.new_notebook(cells=list(cells), metadata=about)


EXPLORER = """
from coursekit import plotting
from coursekit.explore import Slider, explore

def scene(height, sign):
    fig = plotting.figure(2, 1.5)
    fig.subplots().plot([0, height * sign])
    return fig

level = explore(scene, alt="A line to {height}", height=Slider([0, 1, 2], unit="m"), sign=[-1, 1])
"""


def a_level():
    """An explorer of six small pictures, two of which are alike."""
    namespace = {}
    exec(EXPLORER, namespace)
    return namespace["level"]


# The extensions' own business.
pytestmark = pytest.mark.filterwarnings("ignore::sphinx.deprecation.RemovedInSphinx11Warning")


# --- configuration ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def conf():
    return runpy.run_path(str(BOOK / "conf.py"))


def test_the_configuration_names_no_other_server(conf, monkeypatch):
    monkeypatch.delenv("GITHUB_REPOSITORY", raising=False)
    values = {k: v for k, v in conf.items() if not k.startswith("__") and isinstance(v, (str, list, dict))}
    assert [k for k, v in values.items() if k != "os" and "://" in repr(v)] == []
    assert conf["nb_ipywidgets_js"] == {}


def test_everything_that_the_pages_load_exists_here(conf):
    served = [BOOK / path for path in conf["html_static_path"]]
    assert all(path.exists() for path in served)
    names = {path.name for path in served} | {path.name for path in (BOOK / "_static").iterdir()}
    assert {conf["mathjax_path"], *conf["html_css_files"]} <= names
    assert (BOOK / conf["html_logo"]).exists()


def test_every_key_that_is_cited_has_an_entry():
    pages = [p.read_text(encoding="utf-8") for p in [*BOOK.glob("*.md"), *labs.NOTEBOOKS]]
    roles = re.findall(r"\{cite(?::\w+)?\}`([^`]+)`", "\n".join(pages))
    cited = {key.strip() for role in roles for key in role.split(",")}
    assert cited
    assert cited <= set(build.bibliography(BIBLIOGRAPHY).entries)


def test_one_key_for_two_sources_is_refused_and_the_same_source_twice_is_not(tmp_path):
    entry = "@book{{thrun2005, title = {{{}}}, author = {{A}}, year = {{2005}}, publisher = {{P}}}}"
    for name, title in [("a", "Probabilistic Robotics"), ("b", "Probabilistic Robotics"), ("c", "Another Book")]:
        (tmp_path / f"{name}.bib").write_text(entry.format(title))
    assert list(build.bibliography([tmp_path / "a.bib", tmp_path / "b.bib"]).entries) == ["thrun2005"]
    with pytest.raises(ValueError, match=r"c\.bib.*thrun2005"):
        build.bibliography([tmp_path / "a.bib", tmp_path / "c.bib"])


def test_the_front_page_has_a_card_for_every_lab():
    cards = set(re.findall(r"^(\d\d_\w+):", (BOOK / "index.md").read_text(encoding="utf-8"), re.M))
    assert {path.stem for path in labs.NOTEBOOKS} <= cards


def test_the_explorer_on_the_front_page_survives_a_sweep():
    assert sweep(cover.explorer()) == []


def test_the_explorer_on_the_front_page_shows_what_its_words_say():
    path, clouds, beliefs = cover.drive()
    spreads = [cover.doubt(cloud[:, :2]) for cloud in clouds]
    assert clouds[-1].shape == (500, 3) and spreads[-1] > 4 * spreads[5] and spreads[-1] > 1.0
    for k, belief in enumerate(beliefs):
        error = path[k * cover.EVERY, :2] - belief.mean[:2]
        assert error @ np.linalg.solve(belief.cov[:2, :2], error) < 9.2, "outside the 99 % ellipse"
    assert max(np.sqrt(np.linalg.eigvalsh(b.cov[:2, :2])[-1]) for b in beliefs) < 0.25


# --- running and keeping labs -------------------------------------------------------------------------------


@pytest.fixture
def house(tmp_path):
    """A folder with a package and data of its own, to change without harm."""
    for name in ["coursekit/a.py", "coursekit/scenes/b.py", "data/log.csv", "requirements.lock"]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1")
    return tmp_path


@pytest.mark.parametrize("name", ["coursekit/a.py", "coursekit/scenes/b.py", "data/log.csv", "requirements.lock"])
def test_a_lab_is_stale_when_the_package_the_data_or_the_lock_changes(house, name):
    lab = notebook(code("a = 1"))
    before = execute.key(lab, execute.surroundings(house))
    assert execute.key(lab, execute.surroundings(house)) == before
    (house / name).write_text("2")
    assert execute.key(lab, execute.surroundings(house)) != before


def test_a_lab_is_stale_when_its_code_changes_but_not_when_its_prose_does():
    lab = notebook(prose("Hello"), code("a = 1"), code("b = 2"))
    key = execute.key(lab, "around")
    lab.cells[0].source = "Goodbye"
    lab.cells[1].metadata.tags = ["check"]
    assert execute.key(lab, "around") == key
    lab.cells[1].source = "a = 2"
    assert execute.key(lab, "around") != key


def test_a_lab_is_stale_when_a_recording_of_others_arrives_or_changes(house):
    file = house / "clouds.txt"
    keys = [execute.surroundings(house)]
    for content in ("1 2 3", "4 5 6"):
        file.write_text(content)
        keys.append(execute.surroundings(house, [file]))
    assert len(set(keys)) == 3


def test_the_site_is_not_published_without_the_recordings(monkeypatch, capsys):
    monkeypatch.setattr(build, "recordings", lambda: ([], ["icp_clouds is not here"]))
    monkeypatch.setenv("CI", "true")
    assert build.main([]) == 1
    assert "icp_clouds is not here" in capsys.readouterr().err


def test_a_lab_is_run_once_with_static_sliders_and_kept(house, monkeypatch):
    lab = notebook(code("import os\nprint('static', os.environ['COURSEKIT_STATIC'])"), prose("One."))
    path = house / "01_lab.ipynb"
    nbformat.write(lab, path)
    (first,) = execute.execute([path], 1, house / "kept", house).values()
    assert first.cells[0].outputs[0].text == "static 1\n"

    monkeypatch.setattr(execute, "run", lambda *a: pytest.fail("it was run again"))
    lab.cells[1].source = "Two."
    nbformat.write(lab, path)
    (second,) = execute.execute([path], 1, house / "kept", house).values()
    assert second.cells[1].source == "Two." and second.cells[0].outputs == first.cells[0].outputs


def test_a_lab_that_raises_is_named_with_its_error_and_what_succeeded_is_kept(house):
    good, bad = house / "01_good.ipynb", house / "02_bad.ipynb"
    nbformat.write(notebook(code("1 + 1")), good)
    nbformat.write(notebook(code("1 / 0")), bad)
    with pytest.raises(execute.LabFailed, match=r"(?s)02_bad.*ZeroDivisionError"):
        execute.execute([good, bad], 2, house / "kept", house)
    assert [p.name[:7] for p in (house / "kept").iterdir()] == ["01_good"]


# --- frames become files ------------------------------------------------------------------------------------


def test_every_frame_of_an_explorer_becomes_a_file_and_equal_frames_become_one(tmp_path):
    before = f"<p>before</p>{a_level().html()}<p>after</p>"
    after = explorers.move_frames(before, tmp_path, "../_static/explorers")
    assert "data:image" not in after and "<style>" not in after
    assert after.startswith("<p>before</p>") and after.endswith("<p>after</p>")
    named = re.findall(r'"(\.\./_static/explorers/\w+\.webp)"', after)
    assert len(named) == 6 + 1, "six frames, and the one that is shown first"
    assert {Path(name).name for name in named} == {p.name for p in tmp_path.iterdir()}
    assert len(set(named)) == 5, "0 m up and 0 m down look alike"
    for frame in tmp_path.iterdir():
        assert Image.open(frame).size == (288, 216)
    assert 'loading="lazy"' in after


def test_other_pictures_on_a_page_are_left_as_they_are(tmp_path):
    dot = io.BytesIO()
    Image.new("RGB", (1, 1)).save(dot, "PNG")
    page = f'<img src="data:image/png;base64,{base64.b64encode(dot.getvalue()).decode()}" alt="a dot">'
    assert explorers.move_frames(page, tmp_path, "x") == page
    assert list(tmp_path.iterdir()) == []


# --- one tiny page, all the way -----------------------------------------------------------------------------

one_site = pytest.mark.xdist_group("the tiny site")


@pytest.fixture(scope="module")
def tiny_site(tmp_path_factory):
    """The real pages around one small lab, built with the real configuration, every warning an error."""
    root = tmp_path_factory.mktemp("site")
    lab = notebook(
        prose("# Lab 2 · Range\n\nWord: parallax. See [the notation](../book/notation.md).\n\n$$ r = d $$ (eq-tiny)"),
        code(EXPLORER + "level"),
        prose("```{exercise} Twice (easy)\n:label: ex-tiny\nWrite it.\n```"),
        code("def twice(x):\n    ### BEGIN SOLUTION\n    return 2 * x\n    ### END SOLUTION", ["exercise-solution"]),
        code("assert twice(1) == 2\nprint('checked')", ["check"]),
    )
    next_lab = notebook(
        prose("# Lab 3 · Noise\n\nAfter [Lab 2](02_range_and_bearing.ipynb)."),
        code(
            "from coursekit import plotting\nplotting.use_style()\nfig = plotting.figure(2, 1)\nfig.subplots()\nfig",
            mystnb={"image": {"alt": "Empty axes."}},
        ),
        prose("```{exercise} Thrice (easy)\n:label: ex-thrice\nWrite it.\n```"),
    )
    (root / "notebooks").mkdir()
    nbformat.write(lab, root / "notebooks" / "02_range_and_bearing.ipynb")
    nbformat.write(next_lab, root / "notebooks" / "03_noise_model.ipynb")
    (root / "build" / "html" / "notebooks").mkdir(parents=True)
    (root / "build" / "html" / "notebooks" / "02_old_name.html").write_text("gone")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("CI", raising=False)
        patch.setattr(build, "BUILD", root / "build")
        patch.setattr(build, "SOURCE", root / "build" / "source")
        patch.setattr(build, "HTML", root / "build" / "html")
        patch.setattr(build, "labs", lambda only=None: sorted((root / "notebooks").glob("*.ipynb")))
        assert build.main(["--jobs", "1"]) == 0
    return root / "build" / "html"


@one_site
def test_a_page_is_light_and_its_frames_lie_beside_it(tiny_site):
    page = (tiny_site / "notebooks" / "02_range_and_bearing.html").read_text()
    assert len(page) < 60_000 and "data:image/webp" not in page
    for name in re.findall(r'"\.\./(_static/explorers/\w+\.webp)"', page):
        assert (tiny_site / name).exists()


@one_site
def test_no_page_loads_anything_from_elsewhere(tiny_site):
    for page in tiny_site.rglob("*.html"):
        loaded = re.findall(r"<(?:script|img|link|iframe)[^>]*?(?:src|href)=\"([^\"]+)\"", page.read_text())
        assert loaded
        assert [address for address in loaded if "://" in address or address.startswith("//")] == []


@one_site
def test_solutions_and_checks_are_folded_under_names_of_their_own(tiny_site):
    page = (tiny_site / "notebooks" / "02_range_and_bearing.html").read_text()
    folded = dict(re.findall(r"<details.*?(Show [\w ]+)</p>(.*?)</details>", page, re.S))
    assert "return" in folded["Show a solution"] and "checked" in folded["Show the check"]


@one_site
def test_links_between_labs_and_pages_lead_somewhere(tiny_site):
    page = (tiny_site / "notebooks" / "02_range_and_bearing.html").read_text()
    assert 'href="../notation.html"' in page
    assert 'href="02_range_and_bearing.html"' in (tiny_site / "notebooks" / "03_noise_model.html").read_text()
    assert 'href="notebooks/02_range_and_bearing.html"' in (tiny_site / "index.html").read_text()


@one_site
def test_exercises_are_counted_from_one_on_each_page(tiny_site):
    for page in (tiny_site / "notebooks").glob("*.html"):
        assert "Exercise 1" in page.read_text()


@one_site
def test_the_front_page_shows_the_labs_that_exist_each_with_its_picture(tiny_site):
    index = (tiny_site / "index.html").read_text()
    cards = re.findall(r"sd-card-title[^>]*>\s*(?:<[^>]+>)*\s*(Lab \d)", index)
    assert cards == ["Lab 2", "Lab 3"]
    assert re.findall(r'src="_images/(\w+)\.webp"', index) == ["03_noise_model"], "lab 2 draws no plain picture"


@one_site
def test_a_lab_that_was_renamed_leaves_no_page(tiny_site):
    assert {p.stem for p in (tiny_site / "notebooks").glob("*.html")} == {"02_range_and_bearing", "03_noise_model"}


@one_site
def test_what_a_reader_downloads_has_no_outputs(tiny_site):
    lab = nbformat.read(tiny_site / "_sources" / "notebooks" / "02_range_and_bearing.ipynb", as_version=4)
    assert all(not cell.get("outputs") for cell in lab.cells)


@one_site
def test_the_search_knows_the_words_of_a_lab(tiny_site):
    assert "parallax" in (tiny_site / "searchindex.js").read_text()


def test_a_picture_without_words_is_refused():
    shown = nbformat.v4.new_output("display_data", data={"image/png": "…"})
    lab = notebook(code("fig"))
    lab.cells[0].outputs = [shown]
    with pytest.raises(execute.LabFailed, match=r"03_x\.ipynb, cell 1 .*without words"):
        build.prepare(lab, "03_x.ipynb")
    lab.cells[0].metadata.mystnb = {"image": {"alt": "A line that falls."}}
    build.prepare(lab, "03_x.ipynb")
