import hashlib
import re
from pathlib import Path

import numpy as np
import pytest

from coursekit import datasets
from tests.recordings import recording


@pytest.fixture
def offline(tmp_path, monkeypatch):
    """An empty cache and a network that refuses."""

    def refuse(*args, **kwargs):
        raise ConnectionError("no network")

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(datasets.pooch, "os_cache", lambda name: tmp_path / "cache" / name)
    monkeypatch.setattr(datasets.pooch.HTTPDownloader, "__call__", refuse)
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

    monkeypatch.setattr(datasets.pooch.HTTPDownloader, "__call__", tampered)
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

    monkeypatch.setattr(datasets.pooch.HTTPDownloader, "__call__", served)
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


def test_a_file_missing_from_the_projects_data_says_so_and_a_missing_folder_says_what_to_do(tmp_path, monkeypatch):
    with pytest.raises(FileNotFoundError, match=r"no such file$"):
        datasets.project_file("arenas/atlantis.toml")
    monkeypatch.setattr(datasets, "__file__", str(tmp_path / "site-packages" / "coursekit" / "datasets.py"))
    with pytest.raises(FileNotFoundError, match="clone the repository"):
        datasets.project_file("arenas/lab.toml")


def test_the_real_files_here_are_the_ones_whose_hashes_are_written_down():
    for folder, name in (("landmark_log", "landmark_log_real"), ("icp_clouds", "icp_clouds"), ("mrclam7_robot1",) * 2):
        recording(name)
        for file, digest in datasets.ORIGINS[folder].sha256.items():
            assert hashlib.sha256((datasets.locate(folder) / file).read_bytes()).hexdigest() == digest


def test_a_folder_nobody_knows_is_refused_with_those_there_are():
    with pytest.raises(ValueError, match="no folder named 'moon'; there are: landmark_log"):
        datasets.locate("moon")
