"""The book's workshop, without the book: configuration, running and keeping labs, moving frames, one tiny page."""

import base64
import io
import re
import runpy
import shutil
import sys
from pathlib import Path

import nbformat
import numpy as np
import pytest
from PIL import Image

from coursekit.teaching.explore import sweep
from tests import notebooks

sys.path.insert(0, str(Path(__file__).parent.parent / "book"))
sys.path.insert(0, str(Path(__file__).parent.parent / "book" / "_ext"))
sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import build
import citations
import cover
import execute
import explorers
import finish
import pictures
from reference import api, gallery

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
from coursekit.teaching import plotting
from coursekit.teaching.explore import Slider, explore

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
    assert {conf["mathjax_path"], *conf["html_css_files"]} - {"icons.css"} <= names, "the last step makes the icons"
    assert (BOOK / conf["html_logo"]).exists()


def test_every_key_that_is_cited_has_an_entry():
    pages = [p.read_text(encoding="utf-8") for p in [*BOOK.glob("*.md"), *notebooks.NOTEBOOKS, *notebooks.OPTIONAL]]
    roles = re.findall(r"\{cite(?::\w+)?\}`([^`]+)`", "\n".join(pages))
    cited = {key.strip() for role in roles for key in role.split(",")}
    assert cited
    assert cited <= set(citations.bibliography(BIBLIOGRAPHY).entries)


def test_one_key_for_two_sources_is_refused_and_the_same_source_twice_is_not(tmp_path):
    entry = "@book{{thrun2005, title = {{{}}}, author = {{A}}, year = {{2005}}, publisher = {{P}}}}"
    for name, title in [("a", "Probabilistic Robotics"), ("b", "Probabilistic Robotics"), ("c", "Another Book")]:
        (tmp_path / f"{name}.bib").write_text(entry.format(title))
    assert list(citations.bibliography([tmp_path / "a.bib", tmp_path / "b.bib"]).entries) == ["thrun2005"]
    with pytest.raises(ValueError, match=r"c\.bib.*thrun2005"):
        citations.bibliography([tmp_path / "a.bib", tmp_path / "c.bib"])


def test_the_front_page_has_a_card_for_every_lab():
    cards = set(re.findall(r"^(\d\d\w+):", (BOOK / "index.md").read_text(encoding="utf-8"), re.M))
    assert {path.stem for path in [*notebooks.NOTEBOOKS, *notebooks.OPTIONAL]} <= cards


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
    for name in ["coursekit/a.py", "coursekit/labs/b.py", "data/log.csv", "requirements.lock"]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1")
    return tmp_path


@pytest.mark.parametrize("name", ["coursekit/a.py", "coursekit/labs/b.py", "data/log.csv", "requirements.lock"])
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


@pytest.mark.slow  # it scores a project twice
def test_a_lab_that_is_run_twice_is_the_same_to_the_last_byte(tmp_path):
    lab = notebook(
        code("from coursekit.teaching import exercises\nfrom tqdm.auto import tqdm"),
        code("for _ in tqdm(range(3)): pass"),
        code("from coursekit.labs.lab00.project import PROJECT\nexercises.score('lab00', PROJECT.reference, runs=1)"),
    )
    first, second = (nbformat.writes(execute.run(lab, tmp_path / "01_lab.ipynb")) for _ in range(2))
    assert first == second and "100 of 100" in first


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


# --- the last step -------------------------------------------------------------------------------------------


def test_lines_on_white_are_a_drawing_and_a_camera_image_or_a_map_of_colours_is_not():
    rng = np.random.default_rng(3)
    paper = np.full((160, 240, 3), 255, np.uint8)
    paper[40:43, 20:200] = [0, 114, 178]
    assert pictures.is_drawing(Image.fromarray(paper))
    paper[:, 150:] = rng.integers(0, 240, (160, 90, 3))
    assert not pictures.is_drawing(Image.fromarray(paper))
    assert not pictures.is_drawing(Image.fromarray(np.full((160, 240, 3), 90, np.uint8)))


def test_the_policy_names_the_scripts_of_a_page_by_their_digests_and_changes_with_them():
    page = '<meta charset="utf-8" /><script>a()</script><script type="application/json">{}</script><p onclick="b()">'
    one, other = finish.policy(page), finish.policy(page.replace("a()", "c()"))
    assert one.count("'sha256-") == 2 and "'unsafe-hashes'" in one and "'unsafe-inline'" not in one.split(";")[1]
    assert one != other
    assert finish.FINISHED in finish.close(page)


def test_folds_keep_their_words_and_ids_come_once():
    page = (
        '<title>A &#8212; A</title></head><summary aria-label="Toggle hidden content"><p class="x">Show</p></summary>'
    )
    page += '<p id="a"></p><p id="a"></p><style>.g {}</style><style>.g {}</style>'
    mended = finish.mend(page)
    assert '<summary><span class="x">Show</span></summary>' in mended and "<title>A</title>" in mended
    assert 'id="a"' in mended and 'id="a-2"' in mended
    assert mended.count("<style>") == 1 and mended.index("<style>") < mended.index("</head>")


def test_a_full_stop_stays_with_its_formula_and_a_long_name_in_a_table_breaks_between_words():
    math = '<span class="math notranslate">x</span>'
    entry = f'<span class="symbol" tabindex="0">{math}<span class="symbol-entry">the {math} in m</span></span>'
    mended = finish.mend(f"<p>{math}. Then {math} and {entry}, so {entry} is {math}</p>")
    assert mended.startswith(f'<p><span class="kept">{math}.</span> Then {math} and <span class="kept">{entry},</span>')
    assert mended.endswith(f" {entry} is {math}</p>")
    assert finish.mend(f"<p>so ({math}) is</p>") == f'<p>so <span class="kept">({math})</span> is</p>'
    code = '<code class="docutils literal"><span class="pre" id="a_b">half_a_circle</span></code>'
    cell = f"<td><p>{code}, not_code</p></td>"
    assert finish.mend(f"<p>{code}</p>{cell}") == f"<p>{code}</p>" + cell.replace(
        "half_a_circle", "half_<wbr>a_<wbr>circle"
    ).replace('id="a_b"', 'id="a_b-2"')


@pytest.mark.skipif(shutil.which("node") is None, reason="without Node.js the reader's browser typesets the formulas")
def test_formulas_are_typeset_when_the_book_is_built_and_a_mistake_in_one_stops_it(conf):
    page = r'<head></head><body><span class="math notranslate">\(%s\)</span>'
    (done,) = finish.typeset({Path("a"): page % r"\sigma &lt; 1"}, conf["MATHJAX"].parent).values()
    assert "<mjx-container" in done and r"\(" not in done and "<mo>&lt;</mo>" in done
    with pytest.raises(ValueError, match=r"does not understand \\sgima"):
        finish.typeset({Path("a"): page % r"\sgima"}, conf["MATHJAX"].parent)


# --- one tiny page, all the way -----------------------------------------------------------------------------

MARKED = "### BEGIN SOLUTION\n    return r**2 / (h * f) * sigma_px\n    ### END SOLUTION"
one_site = pytest.mark.xdist_group("the tiny site")


@pytest.fixture(scope="module")
def tiny_site(tmp_path_factory):
    """The real pages around one small lab, built with the real configuration, every warning an error."""
    root = tmp_path_factory.mktemp("site")
    lab = notebook(
        prose("# Lab 2 · Range\n\nWord: parallax. See [the notation](../book/notation.md).\n\n$$ r = d $$ (eq-tiny)"),
        prose("## A part\n\nA covariance, and the covariance again."),
        code(EXPLORER + "level"),
        prose("```{exercise} Twice (easy)\n:label: ex-tiny\nWrite it.\n```"),
        code("def twice(x):\n    ### BEGIN SOLUTION\n    return 2 * x\n    ### END SOLUTION", ["exercise-solution"]),
        code("assert twice(1) == 2\nprint('checked')", ["check"]),
    )
    next_lab = notebook(
        prose("# Lab 3 · Noise\n\nAfter [Lab 2](02_range_and_bearing.ipynb), {eq}`eq-tiny`."),
        code(
            "from coursekit import plotting\nplotting.use_style()\nfig = plotting.figure(2, 1)\nfig.subplots()\nfig",
            mystnb={"image": {"alt": "Empty axes."}},
        ),
        prose("```{exercise} Thrice (easy)\n:label: ex-thrice\nWrite it.\n```"),
        code(f"def sigma(r, sigma_px, h, f):\n    {MARKED}", ["exercise-solution"]),
        code('from coursekit import exercises\nexercises.check("lab03.range_sigma", sigma)', ["check"]),
    )
    (root / "notebooks").mkdir()
    nbformat.write(lab, root / "notebooks" / "02_range_and_bearing.ipynb")
    nbformat.write(next_lab, root / "notebooks" / "03_noise_model.ipynb")
    (root / "build" / "html" / "notebooks").mkdir(parents=True)
    (root / "build" / "html" / "notebooks" / "02_old_name.html").write_text("gone")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("CI", raising=False)
        patch.delenv("GITHUB_REPOSITORY", raising=False)
        patch.setattr(build, "BUILD", root / "build")
        patch.setattr(build, "SOURCE", root / "build" / "source")
        patch.setattr(build, "HTML", root / "build" / "html")
        patch.setattr(api, "ROOMS", {"ekf": ["ekf"]})
        patch.setattr(gallery, "drawn", lambda *_: (BOOK / "_static" / "readme.png").read_bytes())
        patch.setattr(build, "labs", lambda only=None: sorted((root / "notebooks").glob("*.ipynb")))
        (root / "pyodide").mkdir()
        (root / "pyodide" / "pyodide.mjs").write_bytes(b"3 MB of Python")
        patch.setattr(build.engine, "fetch", lambda: root / "pyodide")
        assert build.main(["--jobs", "1"]) == 0
    return root / "build" / "html"


@one_site
def test_a_term_in_a_lab_leads_to_its_entry_in_the_glossary(tiny_site):
    page = (tiny_site / "notebooks" / "02_range_and_bearing.html").read_text()
    (link,) = re.findall(r'<a class="term[^>]*>covariance</a>', page)
    anchor = re.search(r'href="\.\./glossary\.html#([^"]+)"', link)[1]
    assert f'id="{anchor}"' in (tiny_site / "glossary.html").read_text()
    assert "how errors go together" in link


@one_site
def test_a_number_that_is_counted_on_another_page_says_on_which(tiny_site):
    assert "Lab 2 (1)" in (tiny_site / "notebooks" / "03_noise_model.html").read_text()


@one_site
def test_an_entry_of_the_package_leads_to_its_source_and_stands_in_the_index(tiny_site):
    page = (tiny_site / "api" / "ekf.html").read_text()
    source, anchor = re.search(r'href="\.\./(_modules/[^"#]+)#([^"]+)"', page).groups()
    assert f'id="{anchor}"' in (tiny_site / source).read_text()
    index = (tiny_site / "genindex.html").read_text()
    assert "api/ekf.html#coursekit.ekf.filter.predict" in index and "glossary.html#term-" in index


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
    folded = dict(re.findall(r"<details.*?(Show [\w ]+)</span>(.*?)</details>", page, re.S))
    assert "return" in folded["Show a solution"] and "checked" in folded["Show the check"]


@one_site
def test_an_exercise_is_answered_on_its_page_and_only_such_a_page_loads_the_editor(tiny_site):
    with_check, without = (
        (tiny_site / "notebooks" / f"{name}.html").read_text("utf-8")
        for name in ("03_noise_model", "02_range_and_bearing")
    )
    assert 'data-check="lab03.range_sigma" data-function="sigma"' in with_check
    editor = with_check[with_check.index("<textarea") : with_check.index("</textarea>")]
    assert "raise NotImplementedError" in editor and "sigma_px\n" not in editor
    assert "answers.js" in with_check and "answers.css" in with_check
    assert "answers.js" not in without and "answers.css" not in without
    python = tiny_site / "_static" / "python"
    assert {path.name for path in python.iterdir()} == {"pyodide.mjs", "worker.js", "engine.js", "checks.zip"}


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
def test_a_reader_downloads_the_lab_to_fill_in_or_the_solved_one(tiny_site):
    page = tiny_site / "notebooks" / "02_range_and_bearing.html"
    menu = re.search(r'dropdown-download-buttons">.*?</ul>', page.read_text(), re.S)[0]
    links = dict(zip(re.findall(r'text-container">([^<]+)', menu), re.findall(r'<a href="([^"]+)"', menu)))
    assert list(links) == ["Lab to fill in", "Solved lab"]
    to_fill_in, solved = (nbformat.read(page.parent / link, as_version=4) for link in links.values())
    for lab in (to_fill_in, solved):
        assert all(not cell.get("outputs") for cell in lab.cells)
    assert "2 * x" not in nbformat.writes(to_fill_in) and "your lines here" in nbformat.writes(to_fill_in)
    assert "2 * x" in nbformat.writes(solved) and "(solved)" in solved.cells[0].source


@one_site
def test_no_other_file_of_the_site_is_a_notebook_with_solutions(tiny_site):
    assert {path.name for path in tiny_site.rglob("*.ipynb") if "2 * x" in path.read_text()} == {
        "02_range_and_bearing.solved.ipynb"
    }


@one_site
def test_each_page_names_its_edition_and_none_needs_a_repository(tiny_site):
    for page in [*tiny_site.glob("*.html"), *(tiny_site / "notebooks").glob("*.html")]:
        text = page.read_text()
        assert re.search(r'<p class="edition">Version \d+\.\d+\.\d+', text), page.name
        assert "mybinder.org/v2" not in text and "colab.research" not in text
    assert '"here": "v' in (tiny_site / "versions.json").read_text()


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
