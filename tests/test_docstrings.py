"""What people call tells them all they need: shapes or units, errors, the source, and an example that runs."""

import inspect
import re

import pytest

import coursekit

# The contract: rooms and, in each, what people call.
CONTRACT = {
    "geometry": "wrap_angle compose inverse between transform",
    "gaussian": "Gaussian nees nis chi2_band ellipse",
    "pinhole": "Camera range_bearing",
    "landmarks": "find_corners measure",
    "noise": "load_log fit_piecewise fit_calibrated",
    "ekf": "predict correct correct_together correct_robustly gate_threshold Watch",
    "models": "DifferentialDrive ConstantVelocity RangeBearing RangeOnly Position "
    "ScaledRange WithConstants Numerical jacobian",
    "slam": "EkfSlam FirstEstimateSlam InvariantSlam",
    "association": "Euclidean Mahalanobis JointCompatibility Known KnownMap",
    "icp": "align find_start scan_to_scan scan_to_map point_to_point move",
    "particles": "Particles predict weigh weigh_together nis resample effective_sample_size "
    "systematic stratified multinomial residual wheel",
    "visual": "MapMatcher",
    "experiments": "monte_carlo",
    "explore": "explore Slider",
    "datasets": "load list about",
    "recordings": "read_landmark_log read_cloud read_mrclam read_bag read_images write_bag read_carmen read_csv_log "
    "read_csv write_csv read_tum write_tum read_kitti write_kitti read_map write_map absolute_error relative_error "
    "matched Recording Trajectory",
    "localisation": "start_of events moments part truth_at localise",
    "exercises": "check score",
}
NAMES = [f"{room}.{name}" for room, names in CONTRACT.items() for name in names.split()]


def said(name):
    """The docstring of a name, with those of its public methods."""
    room, name = name.split(".")
    thing = getattr(getattr(coursekit, room), name)
    own = inspect.getdoc(thing) or ""
    if inspect.isclass(thing):
        own += "\n".join(
            inspect.getdoc(m) or "" for k, m in vars(thing).items() if not k.startswith("_") and callable(m)
        )
    return own


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_says_what_is_raised(name):
    assert re.search(r"\b[Rr]aises?\b|never an exception", said(name))


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_says_shapes_or_units(name):
    assert re.search(r"\([\w., …×-]*\d*\)|\b(m|rad|px|seconds|metres|radians|pixels)\b", said(name))


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_shows_an_example_that_runs(name):
    room, _ = name.split(".")
    whole = getattr(coursekit, room).__doc__ or ""
    # One made-up recording serves the four functions that a recording needs.
    assert ">>> " in (said(name) + whole if room == "localisation" else said(name))


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_tells_its_source_or_its_room_does(name):
    room, _ = name.split(".")
    ours = {"experiments", "explore", "datasets", "exercises", "recordings", "localisation"}
    assert room in ours or "Source" in said(name) or "Source" in (getattr(coursekit, room).__doc__ or "")
