"""What leaves the repository: links to other people's machines, editions side by side, one ZIP for one commit."""

import json
import os
import re
import subprocess
import sys
import zipfile
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import nbformat
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
sys.path.insert(0, str(Path(__file__).parent.parent / "book" / "_ext"))
sys.path.insert(0, str(Path(__file__).parent.parent / "book"))
import along
import assemble_site
import build
import edition
import install_here
import launch
import pdf

ROOT = Path(__file__).parent.parent
HERE = "https://github.com/someone/where-am-i"
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")


@pytest.fixture
def known(monkeypatch):
    monkeypatch.setattr(edition, "repository", lambda: HERE)
    monkeypatch.setattr(edition, "ref", lambda: "v1.2.3")


@pytest.fixture
def unknown(monkeypatch):
    monkeypatch.setattr(edition, "repository", lambda: "")


# --- the one address -----------------------------------------------------------------------------------------


def test_the_project_names_its_repository_or_the_runner_does_or_nobody(monkeypatch):
    urls = {}
    monkeypatch.setattr(edition, "_project", lambda: {"version": "1.2.3", "urls": urls})
    monkeypatch.delenv("GITHUB_REPOSITORY", raising=False)
    assert (edition.repository(), edition.site()) == ("", "")
    monkeypatch.setenv("GITHUB_REPOSITORY", "Owner/name")
    assert edition.repository() == "https://github.com/Owner/name"
    assert edition.site() == "https://owner.github.io/name/"
    urls["repository"] = HERE
    assert edition.repository() == HERE
    urls["repository"] = HERE + "/issues"
    with pytest.raises(ValueError, match=r"expected https://github\.com/owner/name, got .*issues"):
        edition.repository()


def menu(page):
    context = {"header_buttons": [], "pathto": lambda name: f"../{name}.html"}
    app = SimpleNamespace(config=SimpleNamespace(course_repository=edition.repository()))
    launch.offer(app, page, "page.html", context, None)
    return {b["text"]: b["url"] for group in context["header_buttons"] for b in group["buttons"]}


def test_a_lab_can_be_opened_elsewhere_and_another_page_can_not(known):
    links = menu("notebooks/04_ekf")
    assert links == {
        "Binder": "https://mybinder.org/v2/gh/someone/where-am-i/v1.2.3?urlpath=lab/tree/my_labs/04_ekf.ipynb",
        "Colab": "https://colab.research.google.com/github/someone/where-am-i/blob/student/04_ekf.ipynb",
        "JupyterHub": "../run_elsewhere.html#your-hub",
    }
    assert menu("notation") == {}
    assert launch.hub("https://hub.edu/", HERE, "04_ekf") == (
        "https://hub.edu/hub/user-redirect/git-pull?repo=https%3A%2F%2Fgithub.com%2Fsomeone%2Fwhere-am-i"
        "&branch=student&urlpath=lab%2Ftree%2Fwhere-am-i%2F04_ekf.ipynb"
    )


def test_without_an_address_no_link_is_made(unknown):
    assert menu("notebooks/04_ekf") == {}


def a_lab():
    return nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("See [it](../book/notation.md#units).")])


def test_a_lab_on_its_own_fetches_the_course_and_its_links_lead_to_the_site(known):
    first, text = build.alone(a_lab()).cells
    assert "git clone --quiet --depth 1 --branch v1.2.3 " + HERE in first.source
    assert (ROOT / re.search(r"%run where-am-i/(\S+)", first.source)[1]).exists()
    assert text.source == "See [it](https://someone.github.io/where-am-i/notation.html#units)."


def test_a_lab_whose_repository_is_unknown_stays_as_it_is(unknown):
    assert build.alone(a_lab()).cells[0].source == a_lab().cells[0].source


# --- from the lock -------------------------------------------------------------------------------------------


def test_what_is_installed_elsewhere_is_what_the_labs_compute_with_each_line_with_its_hash():
    entries = install_here.wanted(LOCK, install_here.needed(), {})
    names = {re.match(r"[\w.-]+", entry)[0] for entry in entries}
    assert {"numpy", "scipy", "matplotlib", "contourpy", "opencv-python-headless", "cffi", "ipywidgets"} <= names
    assert not names & {"jupyterlab", "sphinx", "pytest"}
    assert all("--hash=sha256:" in entry for entry in entries)


def test_the_running_kernel_keeps_what_it_is_made_of():
    installed = {"ipython": "7.34.0", "traitlets": "5.7.1", "numpy": "1.26.0"}
    entries = install_here.wanted(LOCK, ["numpy", "ipywidgets"], installed)
    names = {re.match(r"[\w.-]+", entry)[0] for entry in entries}
    assert "numpy" in names and "ipywidgets" in names and not names & {"ipython", "traitlets"}
    numpy = re.search(r"^numpy==(\S+)", "".join(install_here.pins(LOCK).values()), re.M)[1]
    assert "numpy" not in "".join(install_here.wanted(LOCK, ["numpy"], {"numpy": numpy}))


def test_the_other_machines_are_told_to_install_the_lock_and_nothing_else():
    assert re.findall(r"^[^#\n].*", (ROOT / ".binder" / "requirements.txt").read_text(), re.M) == [
        "-r ../requirements.lock"
    ]
    assert os.access(ROOT / ".binder" / "postBuild", os.X_OK)
    command = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())["postCreateCommand"]
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    assert command.split()[0] == "make" and set(command.split()[1:]) <= targets


def fresh(folder, *packages):
    """The python of a clean environment, with these packages in it."""
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = folder / "bin" / "python"
    if packages:
        subprocess.run([python, "-m", "pip", "install", "--quiet", *packages], check=True)
    return python


IMPORTS = "import coursekit.ekf, coursekit.slam, coursekit.icp, coursekit.visual, coursekit.teaching.explore"


@pytest.fixture
def checkout(tmp_path):
    """The committed files alone, without the workshop's environment."""
    subprocess.run(["git", "clone", "--quiet", "--depth", "1", f"file://{ROOT}", tmp_path / "where-am-i"], check=True)
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "COURSEKIT_DATA", "VIRTUAL_ENV")}
    return tmp_path / "where-am-i", clean


@pytest.mark.slow
def test_binders_commands_install_the_course_and_lay_out_the_labs(tmp_path, checkout):
    repository, clean = checkout
    python = fresh(tmp_path / "binder")
    clean |= {"PATH": f"{python.parent}:{clean['PATH']}"}
    install = [python, "-m", "pip", "install", "--quiet", "-r", ".binder/requirements.txt"]
    for command in (install, ["bash", ".binder/postBuild"], [python, "-c", IMPORTS]):
        subprocess.run(command, cwd=repository, env=clean, check=True)
    assert (repository / "my_labs" / "04_ekf.ipynb").exists()
    subprocess.run([python, "-m", "jupyter", "lab", "--version"], cwd=tmp_path, env=clean, check=True)


@pytest.mark.slow
def test_the_first_cell_makes_a_bare_kernel_run_a_lab(tmp_path, checkout, known, monkeypatch):
    repository, clean = checkout
    python = fresh(tmp_path / "kernel", "ipykernel", "nbclient", "packaging")
    subprocess.run([python, "-m", "pip", "uninstall", "--quiet", "--yes", "ipywidgets"], check=True)
    monkeypatch.setattr(edition, "repository", lambda: f"file://{repository}")
    monkeypatch.setattr(edition, "ref", lambda: "HEAD")
    monkeypatch.setattr(edition, "site", lambda: "https://somewhere/")
    lab = build.alone(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(IMPORTS)]))
    lab.cells[0].source = lab.cells[0].source.replace(" --branch HEAD", "")
    (tmp_path / "alone").mkdir()
    nbformat.write(lab, tmp_path / "alone" / "lab.ipynb")
    run = (
        "import nbformat, nbclient; lab = nbformat.read('lab.ipynb', 4);"
        "nbclient.NotebookClient(lab, timeout=900, kernel_name='python3').execute()"
    )
    clean |= {"PATH": f"{python.parent}:{clean['PATH']}"}
    subprocess.run([python, "-c", run], cwd=tmp_path / "alone", env=clean, check=True)


# --- the ZIP and the links to what is taken along ---------------------------------------------------------------


@pytest.fixture
def site(tmp_path):
    folder = tmp_path / "html"
    (folder / "notebooks").mkdir(parents=True)
    (folder / "index.html").write_text('<nav class="bd-links"></nav><div class="take-along"></div>')
    (folder / "notebooks" / "04_ekf.html").write_text("<p>page</p>")
    return folder


def test_one_commit_makes_one_zip_byte_for_byte(site, tmp_path, monkeypatch):
    monkeypatch.setattr(edition, "date", lambda: datetime(2030, 1, 31, 12, tzinfo=UTC))
    along.pack(site, tmp_path / "a.zip")
    for file in site.rglob("*.html"):
        os.utime(file, (1e9, 1e9))
    along.pack(site, tmp_path / "b.zip")
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        assert archive.namelist() == ["where-am-i/index.html", "where-am-i/notebooks/04_ekf.html"]


def test_without_a_chromium_the_site_has_its_zip_and_no_pdf_and_no_link_to_one(site, monkeypatch):
    monkeypatch.setattr(pdf, "browser", lambda: None)
    for _ in range(2):  # a second time neither doubles the links nor packs the old ZIP
        along.main(site)
        front = (site / "index.html").read_text()
        assert re.findall(r'href="([^"]+)"', front) == ["where-am-i.zip"]
        assert not (site / pdf.NAME).exists()
        with zipfile.ZipFile(site / "where-am-i.zip") as archive:
            assert "where-am-i.zip" not in archive.read("where-am-i/index.html").decode()
            assert "where-am-i/where-am-i.zip" not in archive.namelist()


def test_with_a_chromium_the_front_page_leads_to_the_pdf_and_the_zip_holds_it(site, monkeypatch):
    monkeypatch.setattr(pdf, "browser", lambda: "chromium")
    monkeypatch.setattr(pdf, "make", lambda site, path: path.write_bytes(b"%PDF") and 350)
    along.main(site)
    assert '<a href="where-am-i.pdf">the whole book as a PDF of 350 pages</a>' in (site / "index.html").read_text()
    with zipfile.ZipFile(site / "where-am-i.zip") as archive:
        assert "where-am-i/where-am-i.pdf" in archive.namelist()


# --- editions side by side --------------------------------------------------------------------------------------


def sites(folder, **words):
    for version, text in words.items():
        with zipfile.ZipFile(folder / f"site-{version.replace('_', '.')}.zip", "w") as archive:
            archive.writestr("where-am-i/index.html", text)
            archive.writestr("where-am-i/versions.json", "{}")
    return sorted(folder.glob("site-*.zip"))


def test_old_editions_stay_and_the_newest_is_at_the_root(tmp_path):
    archives = sites(tmp_path, v0_9_0="nine", v0_10_0="ten", v0_10_1="ten and one")
    assert assemble_site.assemble(archives, tmp_path / "public") == ["v0.10", "v0.9"]
    pages = {p.parent.name: p.read_text() for p in (tmp_path / "public").rglob("index.html")}
    assert pages == {"public": "ten and one", "v0.10": "ten and one", "v0.9": "nine"}
    old = json.loads((tmp_path / "public" / "v0.9" / "versions.json").read_text())
    assert old["here"] == "v0.9" and old["root"] == "../"
    assert [v["folder"] for v in old["versions"]] == ["", "v0.9/"]


@pytest.mark.parametrize("name", ["site-1.0.0.zip", "site-v1.0.zip", "v1.0.0.zip"])
def test_an_archive_without_a_version_is_refused(tmp_path, name):
    with pytest.raises(ValueError, match=r"expected site-v1\.2\.3\.zip"):
        assemble_site.assemble([tmp_path / name], tmp_path / "public")


def test_an_archive_that_reaches_out_of_its_folder_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "site-v1.0.0.zip", "w") as archive:
        archive.writestr("x/../../out.html", "gone")
    with pytest.raises(ValueError, match="outside"):
        assemble_site.assemble([tmp_path / "site-v1.0.0.zip"], tmp_path / "public")
    assert not (tmp_path / "out.html").exists()


def test_what_is_too_large_to_publish_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(assemble_site, "LIMIT", 10)
    with pytest.raises(ValueError, match=r"leave out v0\.1"):
        assemble_site.assemble(sites(tmp_path, v0_1_0="a page"), tmp_path / "public")


# --- paper ------------------------------------------------------------------------------------------------------


def test_the_chapters_of_the_pdf_stand_in_the_order_of_the_sidebar(site):
    links = '<a class="internal" href="notebooks/04_ekf.html">4</a><a class="internal" href="#">front</a>'
    (site / "index.html").write_text(f'<nav class="bd-links">{links}<a class="internal" href="gone.html">x</a></nav>')
    assert pdf.chapters(site) == {"index.html": "index", "notebooks/04_ekf.html": "04_ekf"}


def test_the_contents_name_each_headings_page():
    headings = [{"level": 1, "text": "R < Q", "id": "a"}, {"level": 2, "text": "Why", "id": "a--b"}]
    lines = re.findall(r'href="#([^"]+)" data-page="(\w+)"><span>([^<]+)', pdf.contents(headings, [7, 8]))
    assert lines == [("a", "7", "R &lt; Q"), ("a--b", "8", "Why")]
    with pytest.raises(ValueError):
        pdf.contents(headings, [7])
