"""Exercises answered on the page, without a browser: the editors, what travels to a reader, and where it is from."""

import base64
import hashlib
import html
import io
import json
import re
import subprocess
import sys
import tarfile
import zipfile
from functools import cache
from pathlib import Path

import nbformat
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.special
import scipy.stats

from coursekit.teaching import exercises

sys.path.insert(0, str(Path(__file__).parent.parent / "book"))
sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import answers
import engine

ROOT = Path(__file__).parent.parent
LABS = sorted((ROOT / "notebooks").glob("[0-9][0-9]_*.ipynb"))


@cache
def editors(lab, python=12.0):
    """The HTML under each exercise of a lab that is answered on its page."""
    notebook = nbformat.read(lab, as_version=4)
    answers.offer(notebook, lab.name, python)
    return [cell.source for cell in notebook.cells if cell.source.startswith("```{raw} html")]


# --- the editors --------------------------------------------------------------------------------------------


def test_every_exercise_with_a_check_has_an_editor_on_its_lab_s_page():
    asked = [re.findall('data-check="([^"]+)"', editor) for lab in LABS for editor in editors(lab)]
    assert sorted(name for names in asked for name in names) == exercises.names()


@pytest.mark.parametrize("lab", LABS, ids=lambda p: p.stem)
def test_an_editor_holds_the_stub_that_the_check_answers_and_no_solution(lab):
    for editor in editors(lab):
        stub = html.unescape(re.search(r"<textarea[^>]*>\n(.*)</textarea>", editor, re.DOTALL)[1])
        name, function = re.search('data-check="([^"]+)" data-function="([^"]+)"', editor).groups()
        assert "SOLUTION" not in stub and f"def {function}(" in stub
        space = {}
        exec(stub, space)
        assert "Nothing here yet" in exercises.check(name, space[function]).hint


def test_the_lab_s_imports_go_with_an_editor():
    known = html.unescape(re.search('data-imports="([^"]*)"', editors(LABS[4])[0])[1])
    assert "import numpy as np" in known.splitlines() and "geometry import wrap_angle" in known


def test_without_a_python_the_lab_is_offered_for_jupyterlab():
    for editor in editors(LABS[4], python=None):
        assert 'href="../_sources/notebooks/04_ekf.ipynb" download' in editor
        assert "textarea" not in editor


# --- what travels -------------------------------------------------------------------------------------------

WITHOUT = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {"matplotlib", "cv2", "pymunk", "pooch", "PIL", "joblib", "IPython", "ipywidgets"}:
            raise ImportError(f"there is no {name} in a browser")

sys.meta_path.insert(0, Absent())
sys.path[:] = [ARCHIVE, *(p for p in sys.path if p != ROOT)]
"""


@pytest.fixture(scope="module")
def in_a_bare_python(tmp_path_factory):
    """Run code in a process with NumPy alone, which imports the package from the archive, as a browser does."""
    archive = tmp_path_factory.mktemp("page") / "checks.zip"
    archive.write_bytes(answers.checks())

    def run(code):
        start = f"ARCHIVE, ROOT = {str(archive)!r}, {str(ROOT)!r}\n{WITHOUT}\n"
        command = [sys.executable, "-P", "-c", start + code]
        done = subprocess.run(command, capture_output=True, text=True, cwd=archive.parent, timeout=60)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


def test_every_check_runs_from_the_archive_with_numpy_alone(in_a_bare_python):
    """And what it imports of SciPy is the part that travels."""
    said = in_a_bare_python("""
import json
from coursekit.teaching import exercises, on_page
import scipy, coursekit
def stub(*_):
    raise NotImplementedError
hints = {name: exercises.check(name, stub).hint for name in exercises.names()}
right = "def f(z, z_hat):\\n    return np.array([z[0] - z_hat[0], wrap_angle(z[1] - z_hat[1])])"
right = on_page.judge("lab04.innovation", "f", right, "import numpy as np\\nfrom coursekit.geometry import wrap_angle")
print(json.dumps([hints, json.loads(right), [m.__file__ for m in (scipy, coursekit)]]))
""")
    hints, right, files = said
    assert sorted(hints) == exercises.names()
    assert all("Nothing here yet" in hint for hint in hints.values())
    assert right["passed"]
    assert all("checks.zip" in file for file in files)


def test_the_same_sources_give_the_same_archive_and_nothing_but_sources():
    first = answers.checks()
    assert first == answers.checks.__wrapped__()
    names = zipfile.ZipFile(io.BytesIO(first)).namelist()
    assert {Path(name).suffix for name in names} == {".py"}
    assert {name.split("/")[0] for name in names} == {"coursekit", "scipy"}


def test_the_part_of_scipy_that_travels_agrees_with_scipy(in_a_bare_python):
    shares, degrees = [0.001, 0.025, 0.5, 0.95, 0.99, 1 - 1e-6], [1, 2, 3, 7, 60, 280, 5000]
    got = in_a_bare_python(f"""
import json, numpy as np, scipy.stats as s, scipy.special as p, scipy.linalg as l, scipy.optimize as o
from scipy.linalg.lapack import dpotrf
from scipy.linalg.blas import dtrsm, dtrsv
rng = np.random.default_rng(3)
A = rng.normal(size=(4, 4)); A = A @ A.T + np.eye(4); b = rng.normal(size=4); B = rng.normal(size=(4, 3))
U, _ = dpotrf(A)
L, _ = dpotrf(A, 1)
def miss(x):
    return np.exp(-x[0] * np.arange(6.0)) + x[1] - np.exp(-0.7 * np.arange(6.0)) - 0.2
values = [
    [s.chi2.ppf({shares}, d) for d in {degrees}], [s.chi2.cdf([0.1, 2.0, 90.0], d) for d in {degrees}],
    s.norm.ppf({shares}), s.norm(1, [2.0, 3.0]).logpdf(0.5), s.norm.cdf([-3.0, 0.2]), s.norm(0, 2).pdf([0.0, 1.0]),
    p.ndtri({shares}), p.gammaincinv([[0.5], [1.0], [30.0]], {shares}),
    p.logsumexp([-1000.0, -1001.0]), p.logsumexp(B, axis=1), p.logsumexp(B, axis=0, b=np.c_[1:5], keepdims=True),
    U, np.triu(U).T @ np.triu(U) - A,
    dtrsv(U, b, trans=1), dtrsv(L, b, lower=1), dtrsm(1.0, U, B.T, side=1), dtrsm(2.0, L, B, lower=1),
    l.cho_solve(l.cho_factor(A, lower=True), b), l.cho_solve(l.cho_factor(A), B), l.block_diag(A, [[1.0, 2.0]]),
    [dpotrf(-A)[1] > 0, dpotrf(A * np.nan)[1] > 0], o.least_squares(miss, [0.1, 0.0]).x,
]
print(json.dumps([np.asarray(v, dtype=float).tolist() for v in values]))
""")
    rng = np.random.default_rng(3)
    A = rng.normal(size=(4, 4))
    A, b, B = A @ A.T + np.eye(4), rng.normal(size=4), rng.normal(size=(4, 3))
    U, _ = scipy.linalg.lapack.dpotrf(A)
    L, _ = scipy.linalg.lapack.dpotrf(A, 1)
    blas, s = scipy.linalg.blas, scipy.stats
    wanted = [
        [s.chi2.ppf(shares, d) for d in degrees],
        [s.chi2.cdf([0.1, 2.0, 90.0], d) for d in degrees],
        s.norm.ppf(shares),
        s.norm(1, [2.0, 3.0]).logpdf(0.5),
        s.norm.cdf([-3.0, 0.2]),
        s.norm(0, 2).pdf([0.0, 1.0]),
        scipy.special.ndtri(shares),
        scipy.special.gammaincinv([[0.5], [1.0], [30.0]], shares),
        scipy.special.logsumexp([-1000.0, -1001.0]),
        scipy.special.logsumexp(B, axis=1),
        scipy.special.logsumexp(B, axis=0, b=np.c_[1:5], keepdims=True),
        U,
        np.zeros((4, 4)),
        blas.dtrsv(U, b, trans=1),
        blas.dtrsv(L, b, lower=1),
        blas.dtrsm(1.0, U, B.T, side=1),
        blas.dtrsm(2.0, L, B, lower=1),
        np.linalg.solve(A, b),
        np.linalg.solve(A, B),
        scipy.linalg.block_diag(A, [[1.0, 2.0]]),
        [1, 1],
        [0.7, 0.2],
    ]
    for mine, theirs in zip(got, wanted, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-12)


# --- where it comes from ------------------------------------------------------------------------------------


def archive(parts):
    with tarfile.open(fileobj=(out := io.BytesIO()), mode="w:gz") as members:
        for name, content in parts.items():
            (about := tarfile.TarInfo(f"package/{name}")).size = len(content)
            members.addfile(about, io.BytesIO(content))
    return out.getvalue()


WHEEL = b"a wheel"
LOCK = {"packages": {"numpy": {"file_name": "numpy.whl", "sha256": hashlib.sha256(WHEEL).hexdigest()}}}
PARTS = {part: part.encode() for part in engine.PARTS} | {
    "pyodide.mjs": b"const place=`https://packages.example/pyodide/v${V}/full/`",
    "pyodide-lock.json": json.dumps(LOCK).encode(),
}


@pytest.fixture
def registry(monkeypatch):
    """A registry with one Pyodide and one wheel; what it was asked for."""
    packed, asked = archive(PARTS), []
    chosen = "sha512-" + base64.b64encode(hashlib.sha512(packed).digest()).decode()
    monkeypatch.setattr(engine, "pack", lambda name: asked.append(name) or packed)
    monkeypatch.setattr(engine.unpack, "__defaults__", (chosen,))
    monkeypatch.setattr(engine.numpy_wheel, "__defaults__", (lambda url: asked.append(url) or WHEEL,))
    return asked


def test_the_engine_is_fetched_once_and_kept_with_its_wheel(registry, tmp_path):
    folder = engine.fetch(tmp_path)
    assert {path.name for path in folder.iterdir()} == {*engine.PARTS, "numpy.whl"}
    assert (folder / "numpy.whl").read_bytes() == WHEEL
    version = engine.NAME.partition("@")[2]
    assert registry == [engine.NAME, f"https://packages.example/pyodide/v{version}/full/numpy.whl"]
    assert engine.fetch(tmp_path) == folder
    assert len(registry) == 2


def test_an_archive_that_is_not_the_chosen_one_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(engine, "pack", lambda name: archive(PARTS))
    assert engine.fetch(tmp_path) is None
    assert "is not the one that was chosen" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_wheel_that_pyodide_s_lock_does_not_name_is_refused(registry, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(engine.numpy_wheel, "__defaults__", (lambda url: b"another wheel",))
    assert engine.fetch(tmp_path) is None
    assert "its sha256 differs" in capsys.readouterr().err


def test_without_a_network_the_book_goes_without_and_asks_npm_once(registry, tmp_path, monkeypatch, capsys):
    def nowhere(url):
        raise engine.EngineUnavailable(f"{url} cannot be fetched")

    monkeypatch.setattr(engine.numpy_wheel, "__defaults__", (nowhere,))
    assert engine.fetch(tmp_path) is None
    assert engine.fetch(tmp_path) is None
    assert registry == [engine.NAME]
    assert "cannot be fetched" in capsys.readouterr().err


def test_a_site_that_has_no_python_any_more_keeps_none_of_the_old(tmp_path):
    (python := tmp_path / "python").mkdir()
    (python / "pyodide.mjs").write_bytes(b"x" * 1000)
    answers.install(python, tmp_path / "site")
    there = {path.name for path in (tmp_path / "site" / "_static" / "python").iterdir()}
    assert there == {"pyodide.mjs", "checks.zip", "worker.js", "engine.js"}
    assert answers.megabytes(python) == pytest.approx(0.001 + len(answers.checks()) / 1e6)
    answers.install(None, tmp_path / "site")
    assert not (tmp_path / "site" / "_static" / "python").exists()
    assert answers.megabytes(None) is None
