"""The editions of a lab: no solution slips through, the rest stays in its place, and the emptied lab runs."""

import re
import sys
import warnings
from pathlib import Path

import nbformat
import pytest

import coursekit
from coursekit.teaching import exercises
from tests import notebooks

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import citations
import editions

CELL = """def double(x):
    \"\"\"Twice x.\"\"\"
    ### BEGIN SOLUTION
    secret = 2
    return secret * x
    ### END SOLUTION
"""
# What JupyterLab's MyST extension draws of the labs' own roles.
DRAWN = {"eq"}
every_lab = pytest.mark.parametrize("path", notebooks.NOTEBOOKS, ids=lambda p: p.stem)


def code(source, *tags):
    return nbformat.v4.new_code_cell(source, metadata={"tags": list(tags)})


def prose(source, *tags):
    return nbformat.v4.new_markdown_cell(source, metadata={"tags": list(tags)})


def a_notebook(*cells):
    return nbformat.v4.new_notebook(cells=list(cells))


def text(notebook):
    return nbformat.writes(notebook)


# --- what is emptied --------------------------------------------------------------------------------------------


def test_a_solution_is_replaced_by_a_placeholder_and_the_signature_stays():
    namespace = {}
    emptied = editions.empty(CELL)
    assert "secret" not in emptied and "SOLUTION" not in emptied
    exec(emptied, namespace)
    with pytest.raises(NotImplementedError, match="your lines here"):
        namespace["double"](1)


def test_two_solutions_in_one_cell_are_emptied_one_by_one():
    source = CELL + "\nkept = 7\n\n" + CELL.replace("double", "twice")
    emptied = editions.empty(source)
    assert emptied.count("NotImplementedError") == 2 and "kept = 7" in emptied and "def twice" in emptied


def test_code_without_markers_comes_back_letter_by_letter():
    source = "a = 1\n\n\nb = '### a comment'  \n# the solution of x² = 2 starts at 1, ends at 2\n"
    assert editions.empty(source) == source


@pytest.mark.parametrize(
    "change",
    [
        lambda s: s.replace("###", "#"),
        lambda s: s.replace("### ", "###"),
        lambda s: s.replace("BEGIN SOLUTION", "begin solution").replace("END SOLUTION", "End Solution"),
        lambda s: s.replace("BEGIN SOLUTION", "BEGIN_SOLUTION:  "),
        lambda s: s.replace("\n", "\r\n"),
        lambda s: s.replace("\n", "\r"),
        lambda s: s.replace("    ", "\t"),
        lambda s: s.replace("    ###", "###"),
    ],
    ids=["one #", "no space", "lower case", "underscore and colon", "CRLF", "CR", "tabs", "markers at the margin"],
)
def test_a_marker_is_known_however_it_is_spelled(change):
    namespace = {}
    emptied = editions.empty(change(CELL))
    assert "secret" not in emptied and "solution" not in emptied.lower()
    exec(emptied, namespace)
    with pytest.raises(NotImplementedError):
        namespace["double"](1)


def test_the_methods_of_a_class_are_emptied_and_the_class_can_still_be_made():
    body = "        ### BEGIN SOLUTION\n        self.secret = 1\n        ### END SOLUTION\n"
    source = f"class Filter:\n    def __init__(self):\n{body}"
    namespace = {}
    exec(editions.empty(source), namespace)
    with pytest.raises(NotImplementedError):
        namespace["Filter"]()


# --- what is refused --------------------------------------------------------------------------------------------

BODY = "    secret = 2\n    return secret * x\n"
REFUSED = {
    "never ended": CELL.replace("    ### END SOLUTION\n", ""),
    "never begun": CELL.replace("    ### BEGIN SOLUTION\n", ""),
    "begun twice": CELL.replace("    ### END SOLUTION\n", "    ### BEGIN SOLUTION\n"),
    "nested": CELL.replace("    secret", "    ### BEGIN SOLUTION\n    ### END SOLUTION\n    secret", 1),
    "end before begin": f"def f(x):\n    ### END SOLUTION\n{BODY}    ### BEGIN SOLUTION\n",
    "outside a function": "### BEGIN SOLUTION\nanswer = 42\n### END SOLUTION",
    "in a branch outside": "if True:\n    ### BEGIN SOLUTION\n    answer = 42\n    ### END SOLUTION",
    "a whole method": f"class A:\n    ### BEGIN SOLUTION\n    def f(self, x):\n    {BODY}    ### END SOLUTION\n",
    "in a string": f'def f(x):\n    """\n    ### BEGIN SOLUTION\n    Double it.\n    ### END SOLUTION\n    """\n{BODY}',
    "beside code": f"def f(x):\n    secret = 2  ### BEGIN SOLUTION\n{BODY}    ### END SOLUTION\n",
    "misspelled": CELL.replace("SOLUTION", "SOLTUION"),
    "in the plural": CELL.replace("SOLUTION", "SOLUTIONS"),
    "start and stop": CELL.replace("BEGIN", "START").replace("END", "STOP"),
    "hidden tests": CELL.replace("SOLUTION", "HIDDEN TESTS"),
    "another tool's line": "def f(x):\n    secret = 2  # SOLUTION\n    return x\n",
    "no lines": "def f(x):\n    ### BEGIN SOLUTION\n    # think\n    ### END SOLUTION\n",
    "not Python": CELL.replace("return secret", "return (secret"),
    "no markers": f"def f(x):\n{BODY}",
}


@pytest.mark.parametrize("source", REFUSED.values(), ids=REFUSED)
def test_what_can_not_be_emptied_is_refused_by_cell_and_with_what_was_expected(source):
    with pytest.raises(ValueError, match=r"cell 2: .*(expected ### BEGIN SOLUTION|not Python)"):
        editions.student(a_notebook(code("a = 1"), code(source, "exercise-solution")))


@pytest.mark.parametrize("source", [s for name, s in REFUSED.items() if name != "no markers"])
def test_a_tag_is_not_needed_to_be_refused(source):
    with pytest.raises(ValueError, match="cell 1: "):
        editions.student(a_notebook(code(source)))


@pytest.mark.parametrize("kind", ["markdown", "raw"])
@pytest.mark.parametrize("tags", [[], ["exercise-solution"]])
def test_a_solution_outside_code_is_refused(kind, tags):
    source = "It is 2 x." if tags else CELL
    cell = getattr(nbformat.v4, f"new_{kind}_cell")(source, metadata={"tags": tags})
    with pytest.raises(ValueError, match=f"cell 1: a solution in a {kind} cell"):
        editions.student(a_notebook(cell))


def test_a_tag_that_is_nearly_right_is_refused():
    with pytest.raises(ValueError, match="cell 1: expected the tag 'exercise-solution', got 'exercise_solution'"):
        editions.student(a_notebook(code(CELL, "exercise_solution")))


LONG = CELL.replace("secret * x", "secret * x + 0.125 * (x - x) ** 3 - np.hypot(x, x)")


@pytest.mark.parametrize("quote", [code, prose])
@pytest.mark.parametrize("before", [True, False])
def test_a_solution_that_is_quoted_elsewhere_is_refused(quote, before):
    quoted = "\n".join(line.strip() + "  " for line in LONG.split("\n")[3:5])
    cells = [code(LONG, "exercise-solution"), quote(f"look:\n{quoted}\n")]
    with pytest.raises(ValueError, match=r"cell [12]: repeats the solution of cell [12]"):
        editions.student(a_notebook(*(cells[::-1] if before else cells)))


def test_a_solution_in_outputs_attachments_or_metadata_does_not_slip_through():
    notebook = a_notebook(code(CELL, "exercise-solution"), prose("look"))
    notebook.cells[0].outputs = [nbformat.v4.new_output("stream", text="secret")]
    notebook.cells[0].metadata.old = "secret"
    notebook.cells[1].attachments = {"secret.png": {"image/png": "secret"}}
    notebook.metadata.draft = "secret"
    assert "secret" not in text(editions.student(notebook)) and "secret" in text(notebook)


# --- how the editions read --------------------------------------------------------------------------------------


def a_lab():
    return a_notebook(
        prose("# Lab 3: Noise\n\nAs {cite:t}`thrun2005` say, see [the notation](../book/notation.md)."),
        code("import numpy", "hide-input"),
        code(CELL, "exercise-solution"),
        code("exercises.check('lab03.double', double)", "check"),
        code(CELL.replace("double", "filter"), "exercise-solution", "project"),
        prose("Long known {cite}`thrun2005,lowe2004`."),
    )


def test_an_emptied_cell_stands_open_and_its_pointer_comes_after_its_check():
    edition = editions.student(a_lab(), book="../../book")
    kinds = [(c.cell_type, c.metadata.get("tags", []), bool(c.metadata.get("jupyter"))) for c in edition.cells[1:7]]
    assert kinds == [
        ("code", ["hide-input"], True),
        ("code", [], False),
        ("code", ["check"], True),
        ("markdown", [], False),
        ("code", ["project"], False),
        ("markdown", [], False),
    ]
    assert edition.cells[4].source == edition.cells[6].source == editions.STUCK
    assert "make solved" in editions.STUCK and "my_labs/solved/" in editions.STUCK
    assert "[the notation](../../book/notation.md)" in edition.cells[0].source
    nbformat.validate(edition)


def test_the_solved_edition_has_its_solutions_folded_and_says_what_it_is():
    edition = editions.solved(a_lab())
    assert edition.cells[0].source.startswith("# Lab 3: Noise (solved)\n")
    folded = [c.metadata.get("jupyter", {}).get("source_hidden", False) for c in edition.cells[:6]]
    assert folded == [False, True, True, True, True, False]
    assert edition.cells[2].source == CELL.strip("\n")


def test_an_edition_leaves_the_original_alone_and_making_it_twice_gives_the_same():
    original = a_lab()
    before = text(original)
    assert text(editions.student(original)) == text(editions.student(original))
    assert text(original) == before


def test_citations_are_words_and_the_sources_stand_at_the_end():
    edition = editions.student(a_lab())
    assert "As Thrun, Burgard and Fox (2005) say" in edition.cells[0].source
    assert edition.cells[-2].source == "Long known (Thrun, Burgard & Fox, 2005; Lowe, 2004)."
    assert edition.cells[-1].source.startswith("## Sources\n\n- ")
    assert edition.cells[-1].source.count("\n- ") == 2 and "*Probabilistic Robotics*" in edition.cells[-1].source
    assert "\\" not in edition.cells[-1].source


def test_many_authors_are_shortened_and_an_unknown_key_or_form_is_refused():
    assert citations.spell_out("{cite}`adelson1984`", []) == "(Adelson et al., 1984)"
    with pytest.raises(ValueError, match="nobody1900"):
        citations.spell_out("{cite}`nobody1900`", [])
    with pytest.raises(ValueError, match="cite:author"):
        citations.spell_out("{cite:author}`thrun2005`", [])


def test_a_copy_says_which_version_made_it_and_warns_where_another_runs_it(monkeypatch):
    lab = a_notebook(prose("# Lab 4"), code("from coursekit import experiments\nSEED = experiments.lab_seed(4)"))
    for edition in (editions.student(lab), editions.solved(lab)):
        assert edition.metadata.coursekit == {"version": coursekit.__version__, "lab": 4}
        with warnings.catch_warnings(action="error"):
            exec(edition.cells[1].source, {})
    version = coursekit.__version__
    monkeypatch.setattr(coursekit, "__version__", "99.0.0")
    with pytest.warns(UserWarning, match=rf"Lab 4 .* version {re.escape(version)} .* coursekit 99\.0\.0"):
        exec(edition.cells[1].source, {})


@every_lab
def test_every_copy_of_a_lab_is_signed(path):
    edition = editions.student(nbformat.read(path, as_version=4))
    assert edition.metadata.coursekit["lab"] == int(path.stem[:2])


@every_lab
def test_an_edition_holds_no_role_that_jupyterlab_leaves_raw(path):
    lab = nbformat.read(path, as_version=4)
    for edition in (editions.student(lab), editions.solved(lab)):
        prose = "\n".join(c.source for c in edition.cells if c.cell_type == "markdown")
        assert set(re.findall(r"\{([\w:.-]+)\}`", prose)) <= DRAWN


@every_lab
def test_no_line_of_a_solution_is_left_where_it_was(path):
    """Found here by the plain text of the lab, not by the tool's own eyes."""
    lab = nbformat.read(path, as_version=4)
    edition = {c.id: c.source for c in editions.student(lab).cells}
    solutions = [c for c in lab.cells if "exercise-solution" in c.metadata.get("tags", [])]
    assert solutions
    for cell in solutions:
        (first, *rest) = cell.source.split("### BEGIN SOLUTION")
        secret = {line.strip() for part in rest for line in part.split("### END SOLUTION")[0].splitlines()} - {""}
        assert secret and not secret & {line.strip() for line in edition[cell.id].splitlines()}
        assert edition[cell.id].startswith(first.rstrip())


@every_lab
def test_an_emptied_lab_answers_every_check_with_nothing_here_yet(path):
    """Only the cells that exercises need are run: imports, the emptied cells, and their checks."""
    edition = editions.student(nbformat.read(path, as_version=4))
    sources = [c.source for c in edition.cells if c.cell_type == "code"]
    stubs = [s for s in sources if "your lines here" in s]
    checks = [s for s in sources if "exercises.check(" in s]
    namespace = {}
    with exercises.collecting() as verdicts:
        for source in [sources[0], *stubs, *checks]:
            exec(source, namespace)
    assert stubs and verdicts
    assert all("Nothing here yet" in v.hint for v in verdicts)
