import hashlib
import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pooch
import pytest
import tqdm.auto

from coursekit.recordings import datasets
from tests.recorded import recording


@pytest.fixture
def offline(tmp_path, monkeypatch):
    """An empty cache and a network that refuses."""

    def refuse(*args, **kwargs):
        raise ConnectionError("no network")

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(pooch, "os_cache", lambda name: tmp_path / "cache" / name)
    monkeypatch.setattr(pooch.HTTPDownloader, "__call__", refuse)
    monkeypatch.delenv("COURSEKIT_DATA", raising=False)
    return tmp_path


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ValueError, match="landmark_log_real"):
        datasets.load("landmark")


def test_a_recording_that_is_nowhere_says_which_file_where_it_looked_and_what_to_do(offline):
    with pytest.raises(datasets.DatasetUnavailable) as caught:
        datasets.load("landmark_log_real")
    message = str(caught.value)
    for part in ("landmark_log/landmark_data_cyan.csv", "not set", str(offline / "cache"), "b0d0649c",
                 "ConnectionError", "set COURSEKIT_DATA"):  # fmt: skip
        assert part in message
    assert not (offline / "cache").exists() or not list((offline / "cache").rglob("*.csv"))


def test_a_folder_of_yours_is_searched_first_and_believed(offline, monkeypatch):
    folder = offline / "mine" / "icp_clouds"
    folder.mkdir(parents=True)
    (folder / "pclX.txt").write_text("1 2 3\n")
    monkeypatch.setenv("COURSEKIT_DATA", str(offline / "mine"))
    with pytest.raises(datasets.DatasetUnavailable, match=r"no icp_clouds/pclY\.txt"):
        datasets.load("icp_clouds")
    (folder / "pclY.txt").write_text("4 5 6\n7 8 9\n")
    source, target = datasets.load("icp_clouds")
    np.testing.assert_array_equal(source, [[1, 2, 3]])
    assert target.shape == (2, 3)


def test_what_was_fetched_before_is_used_without_network_if_its_hash_still_holds(offline, monkeypatch):
    content = b"1 2 3\n"
    origin = datasets.Origin("someone/something", "0" * 40, "data", {"pclX.txt": hashlib.sha256(content).hexdigest()})
    monkeypatch.setitem(datasets.ORIGINS, "icp_clouds", origin)
    cached = offline / "cache" / "coursekit" / "icp_clouds" / "pclX.txt"
    cached.parent.mkdir(parents=True)
    cached.write_bytes(content)
    assert datasets.locate("icp_clouds") == cached.parent
    cached.write_bytes(b"1 2 4\n")
    with pytest.raises(datasets.DatasetUnavailable):
        datasets.locate("icp_clouds")


def test_a_download_with_the_wrong_hash_is_refused(offline, monkeypatch):
    def tampered(self, url, output_file, pooch, **kwargs):
        output_file = Path(getattr(output_file, "name", output_file))
        output_file.write_text("not the cloud")

    monkeypatch.setattr(pooch.HTTPDownloader, "__call__", tampered)
    with pytest.raises(datasets.DatasetUnavailable, match="hash"):
        datasets.locate("icp_clouds")
    assert not list((offline / "cache").rglob("*.txt"))


def test_a_download_with_the_right_hash_is_kept_under_its_name(offline, monkeypatch):
    content = b"1 2 3\n"
    origin = datasets.Origin("someone/something", "0" * 40, "data", {"pclX.txt": hashlib.sha256(content).hexdigest()})
    monkeypatch.setitem(datasets.ORIGINS, "icp_clouds", origin)
    asked = []

    def served(self, url, output_file, pooch, **kwargs):
        asked.append(url)
        Path(getattr(output_file, "name", output_file)).write_bytes(content)

    monkeypatch.setattr(pooch.HTTPDownloader, "__call__", served)
    assert (datasets.locate("icp_clouds") / "pclX.txt").read_bytes() == content
    datasets.locate("icp_clouds")
    assert asked == [f"https://raw.githubusercontent.com/someone/something/{'0' * 40}/data/pclX.txt"]


def test_every_origin_is_pinned_to_a_commit_and_full_hashes_and_named_in_the_data_folders_readme():
    readme = datasets.project_file("README.md").read_text()
    for folder, origin in datasets.ORIGINS.items():
        assert re.fullmatch("[0-9a-f]{40}", origin.commit)
        for name, digest in origin.sha256.items():
            assert re.fullmatch("[0-9a-f]{64}", digest)
            assert digest in readme and f"{folder}/{name}" in readme
        assert f"{origin.repository} @ {origin.commit}" in readme


def test_a_file_missing_from_the_projects_data_says_so():
    with pytest.raises(FileNotFoundError, match=r"atlantis\.toml: there is no such file in the project's data$"):
        datasets.project_file("arenas/atlantis.toml")


def test_the_projects_data_lie_inside_an_installed_package_and_beside_a_checkouts(tmp_path, monkeypatch):
    package = tmp_path / "site-packages" / "coursekit"
    monkeypatch.setattr(datasets, "__file__", str(package / "recordings" / "datasets.py"))
    for folder in (package.parent / "data", package / "data"):  # the second is preferred: the first may be anybody's
        folder.mkdir(parents=True)
        (folder / "log.csv").write_text("1")
        assert datasets.project_file("log.csv") == folder / "log.csv"


def test_the_real_files_here_are_the_ones_whose_hashes_are_written_down():
    for folder, name in (("landmark_log", "landmark_log_real"), ("icp_clouds", "icp_clouds"), ("mrclam7_robot1",) * 2):
        recording(name)
        for file, digest in datasets.ORIGINS[folder].sha256.items():
            assert hashlib.sha256((datasets.locate(folder) / file).read_bytes()).hexdigest() == digest


def test_a_folder_nobody_knows_is_refused_with_those_there_are():
    with pytest.raises(ValueError, match="no folder named 'moon'; there are: landmark_log"):
        datasets.locate("moon")


# A public origin of our own, on this machine.

CLOUD = b"1 2 3\n" * 20_000


@pytest.fixture
def origin(tmp_path, monkeypatch):
    """A server that behaves as its ``mood`` says, as the origin of icp_clouds; an empty cache."""

    class Answer(BaseHTTPRequestHandler):
        def do_GET(self):
            server.asked.append(self.path)
            if server.mood == "gone":
                return self.send_error(404)
            body = CLOUD.replace(b"3", b"4") if server.mood == "another" else CLOUD
            self.send_response(200)
            if server.mood != "cut off without a length":
                self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body[: len(body) // 2] if server.mood.startswith("cut off") else body)

        def log_message(self, *args):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Answer)
    server.asked, server.mood = [], "well"
    threading.Thread(target=server.serve_forever, daemon=True).start()
    digest = hashlib.sha256(CLOUD).hexdigest()
    local = datasets.Origin("someone/something", "0" * 40, "data", {"pclX.txt": digest, "pclY.txt": digest}, len(CLOUD),
                            "CC0", "Someone (2020)", f"http://127.0.0.1:{server.server_port}")  # fmt: skip
    monkeypatch.setitem(datasets.ORIGINS, "icp_clouds", local)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(pooch, "os_cache", lambda name: tmp_path / "cache" / name)
    monkeypatch.delenv("COURSEKIT_DATA", raising=False)
    monkeypatch.setenv("NO_PROXY", "*")
    server.cache = tmp_path / "cache" / "coursekit" / "icp_clouds"
    yield server
    server.shutdown()
    server.server_close()


def test_what_is_fetched_is_kept_and_asked_for_once(origin):
    assert datasets.load("icp_clouds").source.shape == (20_000, 3)
    assert sorted(p.name for p in origin.cache.iterdir()) == ["pclX.txt", "pclY.txt"]
    origin.mood = "gone"
    assert datasets.load("icp_clouds").target.shape == (20_000, 3)
    assert [path.rpartition("/")[2] for path in origin.asked] == ["pclX.txt", "pclY.txt"]


@pytest.mark.parametrize(
    ("mood", "why"),
    [
        ("gone", "the server refused, status 404"),
        ("another", "hash of downloaded file"),
        ("cut off", "the download broke off"),
        ("cut off without a length", "hash of downloaded file"),
    ],
)
def test_a_download_that_fails_says_why_leaves_nothing_and_can_be_tried_again(origin, mood, why):
    origin.mood = mood
    with pytest.raises(datasets.DatasetUnavailable, match=rf"icp_clouds/pclX.txt .*{why}.*set COURSEKIT_DATA"):
        datasets.load("icp_clouds")
    assert not origin.cache.exists() or not [*origin.cache.iterdir()]
    origin.mood = "well"
    assert len(datasets.load("icp_clouds").source) == 20_000


def test_a_download_that_the_reader_interrupts_leaves_nothing(origin, monkeypatch):
    class Impatient(tqdm.auto.tqdm):
        def update(self, n=1):
            raise KeyboardInterrupt

    monkeypatch.setattr(tqdm.auto, "tqdm", Impatient)
    with pytest.raises(KeyboardInterrupt):
        datasets.load("icp_clouds")
    assert not [*origin.cache.iterdir()]


def test_a_server_that_is_not_there_is_told_as_no_connection(origin):
    origin.shutdown()
    origin.server_close()
    with pytest.raises(datasets.DatasetUnavailable, match="no connection, ConnectionError"):
        datasets.load("icp_clouds")


def test_a_damaged_file_in_the_cache_is_fetched_anew(origin):
    datasets.load("icp_clouds")
    (origin.cache / "pclX.txt").write_text("1 2 4\n")
    assert len(datasets.load("icp_clouds").source) == 20_000
    assert len(origin.asked) == 3


def test_a_progress_bar_names_the_file_and_counts_its_bytes(origin, monkeypatch):
    bars = []

    class Seen(tqdm.auto.tqdm):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **{**kwargs, "disable": False})
            bars.append((kwargs["desc"], self))

        def update(self, n=1):
            self.seen = max(getattr(self, "seen", 0), self.total)
            return super().update(n)

    monkeypatch.setattr(tqdm.auto, "tqdm", Seen)
    datasets.load("icp_clouds")
    assert [desc for desc, _ in bars] == ["icp_clouds/pclX.txt", "icp_clouds/pclY.txt"]
    assert {bar.seen for _, bar in bars} == {len(CLOUD)}


def test_the_list_is_a_table_that_says_where_each_was_found(origin, monkeypatch, tmp_path):
    table = datasets.list()
    assert [*table] == ["icp_clouds", "landmark_log", "landmark_log_real", "mrclam7_robot1"] and not origin.asked

    def row(name):
        return next(line for line in repr(datasets.list()).splitlines() if line.split()[0] == name)

    assert repr(table).splitlines()[0].split() == ["name", "what", "it", "is", "size", "licence", "found"]
    assert re.search(r"0\.1 MB  CC0 +not here; load fetches it$", row("icp_clouds"))
    assert row("landmark_log").endswith("in the project") and "0.2 MB" in row("landmark_log")
    datasets.load("icp_clouds")
    assert row("icp_clouds").endswith("in the cache")
    folder = tmp_path / "mine" / "icp_clouds"
    folder.mkdir(parents=True)
    for name in ("pclX.txt", "pclY.txt"):
        (folder / name).write_text("1 2 3\n")
    monkeypatch.setenv("COURSEKIT_DATA", str(tmp_path / "mine"))
    assert row("icp_clouds").endswith("$COURSEKIT_DATA")
    html = datasets.list()._repr_html_()
    assert html.count("<tr>") == 5 and "<td>CC0</td>" in html


def test_about_states_licence_origin_and_what_to_cite(origin):
    said = datasets.about("icp_clouds")
    assert "Licence: CC0." in said and "Cite: Someone (2020)." in said and f"someone/something @ {'0' * 40}" in said
    assert "educational use only" in datasets.about("mrclam7_robot1") and "Leung" in datasets.about("mrclam7_robot1")
    assert "none stated" in datasets.about("landmark_log_real")
    with pytest.raises(ValueError, match="no data set named 'moon'"):
        datasets.about("moon")


def test_every_origin_states_its_size_licence_and_citation():
    for folder, stated in datasets.ORIGINS.items():
        assert stated.licence and stated.citation
        name = {"landmark_log": "landmark_log_real"}.get(folder, folder)
        recording(name)
        assert stated.size == sum((datasets.locate(folder) / file).stat().st_size for file in stated.sha256)
