"""The estimators need NumPy and SciPy; what needs more says so in one sentence."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from coursekit import extras

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
ESTIMATORS = (
    "geometry, gaussian, models, graph, landmarks, pinhole, noise, ekf, slam, association, icp, particles, recordings, "
    "datasets, exercises, experiments"
)


def in_a_fresh_process(code, *options):
    return subprocess.run(
        [sys.executable, *options, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout


def without(*modules):
    """Code for a process in which these modules cannot be found, as if they were not installed."""
    return (
        "import sys\n"
        "from importlib.machinery import PathFinder\n"
        "find = PathFinder.find_spec\n"
        "def hidden(name, path=None, target=None):\n"
        f"    return None if name.partition('.')[0] in {modules!r} else find(name, path, target)\n"
        "PathFinder.find_spec = hidden\n"
    )


def names(requirements):
    return {Requirement(line).name for line in requirements}


def test_importing_the_estimators_brings_numpy_and_scipy_and_not_its_statistics():
    code = (
        "import sys\n"
        "before = set(sys.modules)\n"
        f"from coursekit import {ESTIMATORS}\n"
        "print(*sorted(set(sys.modules) - before))"
    )
    loaded = in_a_fresh_process(code).split()
    beside = {module for modules in extras.EXTRAS.values() for module in modules}
    assert not beside & {name.partition(".")[0] for name in loaded}
    assert "scipy.linalg" in loaded and "scipy.stats" not in loaded


def test_the_filter_alone_brings_nothing_of_scipy_but_its_linear_algebra():
    code = (
        "import sys, scipy.linalg\n"
        "before = set(sys.modules)\n"
        "from coursekit import ekf\n"
        "print(*sorted({name for name in set(sys.modules) - before if name.startswith('scipy')}))"
    )
    assert in_a_fresh_process(code).split() == []


def test_the_package_asks_for_numpy_and_scipy_alone():
    assert names(PROJECT["dependencies"]) == {"numpy", "scipy"}


@pytest.mark.parametrize("extra", extras.EXTRAS)
def test_each_extra_is_what_pyproject_asks_for(extra):
    asked = names(PROJECT["optional-dependencies"][extra])
    assert asked - {"coursekit"} == set(extras.EXTRAS[extra].values())


def test_the_labs_bring_the_world_and_pictures_too():
    (own,) = [line for line in PROJECT["optional-dependencies"]["labs"] if line.startswith("coursekit")]
    assert Requirement(own).extras == {"visual", "world"}


DOORS = {
    "from coursekit import World": "coursekit.world.robot needs pymunk: pip install 'coursekit[world]'",
    "from coursekit import MapMatcher": "coursekit.visual.direct needs opencv-python-headless: "
    "pip install 'coursekit[visual]'",
    "from coursekit import plotting": "coursekit.teaching.plotting needs matplotlib: pip install 'coursekit[labs]'",
    "coursekit.find_corners(np.zeros((9, 9, 3), np.uint8), 'red')": "coursekit.landmarks.measuring needs "
    "opencv-python-headless: pip install 'coursekit[visual]'",
    "coursekit.monte_carlo(lambda rng: 0, 1, progress=True)": "coursekit.teaching.experiments needs tqdm: "
    "pip install 'coursekit[labs]'",
    "coursekit.recordings.read_bag('drive')": "coursekit.recordings.bags needs rosbags: pip install 'coursekit[ros]'",
}


def test_a_missing_extra_is_one_clear_sentence():
    code = without("pymunk", "cv2", "matplotlib", "tqdm", "rosbags") + "import coursekit, numpy as np\n"
    for door in DOORS:
        code += f"try:\n    {door}\nexcept ModuleNotFoundError as missing:\n    print(missing)\n"
    assert in_a_fresh_process(code).splitlines() == list(DOORS.values())


def test_others_who_miss_the_same_module_get_python_s_own_error():
    code = (
        without("tqdm") + "import coursekit, importlib.util\n"
        "print(importlib.util.find_spec('tqdm'))\n"
        "try:\n    import tqdm\nexcept ModuleNotFoundError as missing:\n    print(missing)"
    )
    assert in_a_fresh_process(code).splitlines() == ["None", "No module named 'tqdm'"]


def test_the_package_tells_about_itself():
    said = subprocess.run(
        [sys.executable, "-m", "coursekit"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    assert said.startswith("coursekit 0.") and "$COURSEKIT_DATA is" in said and "landmark_log " in said
    assert f"numpy {extras.version('numpy')}, scipy {extras.version('scipy')}" in said
    assert f"pymunk {extras.version('pymunk')}" in said


def test_the_package_tells_what_it_lacks(monkeypatch):
    code = without("pymunk", "pooch") + "import runpy; runpy.run_module('coursekit', run_name='__main__')"
    monkeypatch.delenv("COURSEKIT_DATA", raising=False)
    lines = in_a_fresh_process(code).splitlines()
    assert "  world    lacks pymunk: pip install 'coursekit[world]'" in lines
    where = "not here, and coursekit.recordings.datasets needs pooch: pip install 'coursekit[labs]'"
    assert f"  icp_clouds         {where}" in lines
