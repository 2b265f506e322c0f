from pathlib import Path

import numpy as np
import pytest

from coursekit.gaussian import Gaussian, nees
from coursekit.labs.lab00 import explorers, figures, runs
from coursekit.models import pose_residual
from coursekit.teaching.experiments import lab_seed
from coursekit.world.robot import Robot


@pytest.fixture
def drive():
    return explorers.DriveYourself()


def test_each_question_of_the_pad_drives_a_tenth_of_a_second_and_gets_a_picture(drive):
    _, [first] = drive.answer({})
    for _ in range(20):
        said, [picture] = drive.answer({"drive": [0.5, 0.0]})
    assert drive.world.time == pytest.approx(2.0)
    assert 0.7 < drive.world.pose[0] < 1.0 and abs(drive.world.pose[1]) < 0.1
    assert picture != first and picture.startswith(b"\x89PNG")
    assert said["alt"].startswith("After 2.0 s dead reckoning is") and said["moves"]


def test_stop_stops_and_the_pad_is_told_when_the_robot_stands(drive):
    for _ in range(10):
        drive.answer({"drive": [0.5, 0.5]})
    answers = [drive.answer({"drive": [0.0, 0.0]})[0]["moves"] for _ in range(10)]
    assert answers[0] and not answers[-1]
    stood = drive.world.pose
    drive.answer({"drive": [0.0, 0.0]})
    assert drive.world.pose == pytest.approx(stood, abs=1e-4)


def test_reset_brings_back_the_first_picture_and_the_same_noise(drive):
    first = drive.answer({})
    drive.answer({"drive": [0.4, 0.3]})
    once = drive.world.pose
    assert drive.answer({"reset": True}) == first and drive.world.time == 0
    drive.answer({"drive": [0.4, 0.3]})
    assert np.array_equal(drive.world.pose, once)


def test_against_a_wall_an_arrow_tells_how_far_off_the_belief_is(drive):
    for _ in range(200):
        drive.advance(0.8, 0.0)
        if abs(drive.told[-1][0]) < 4.2:
            drive.update(0)
            assert not drive.stage.far.get_visible()
    drive.update(0)
    assert "touches" in drive.stage.title.get_text()
    assert drive.stage.far.get_visible()
    off = np.hypot(*(drive.told[-1] - drive.truth[-1])[:2])
    assert drive.stage.far.get_text() == f"{off:.1f} m off" and off > 5


@pytest.mark.parametrize(
    ("way", "degrees", "style"),
    [
        ((9.0, 0.0), 0, "RArrow"),
        ((-9.0, 0.0), 0, "LArrow"),
        ((0.0, 9.0), 90, "RArrow"),
        ((-9.0, 8.4), -45, "LArrow"),
    ],
)
def test_the_arrow_points_out_of_the_picture(drive, way, degrees, style):
    drive.stage._point_at(np.array(way), np.zeros(2))
    assert drive.stage.far.get_rotation() % 360 == pytest.approx(degrees % 360)
    assert type(drive.stage.far.get_bbox_patch().get_boxstyle()).__name__ == style


def test_the_published_page_gets_words_in_place_of_the_widget(drive, monkeypatch):
    monkeypatch.setenv("COURSEKIT_STATIC", "1")
    bundle = drive._repr_mimebundle_()
    assert bundle["text/plain"].startswith("Recorded drive: press play")
    assert "JupyterLab" in bundle["text/plain"] and "text/markdown" in bundle


def test_keys_are_named_only_where_there_is_a_robot_to_drive():
    notebook = (Path(__file__).parents[3] / "notebooks" / "00_the_world.ipynb").read_text(encoding="utf-8")
    assert "arrow keys" not in notebook
    assert "arrow keys" in explorers.Pad._esm


@pytest.mark.parametrize("slip", runs.SLIPS)
def test_the_recorded_drive_is_long_enough_for_its_slider_and_keeps_clear_of_walls(slip):
    truth, told, covs, crates = runs.recording(slip, lab_seed(0) + 8)
    assert len(truth) == len(told) == len(covs) == len(crates)
    assert 32.0 <= (len(truth) - 1) * runs.PERIOD < 34.0
    assert np.abs(truth[:, 0]).max() < 3.5 and np.abs(truth[:, 1]).max() < 2.5
    moved = np.hypot(*(crates[-1] - crates[0])[:, :2].T)
    assert np.sort(moved)[-1] > 0.4 and np.sort(moved)[-2] < 1e-6


def test_the_banana_is_seen_in_metres_at_first_sight():
    """At 8 % and 20 s: half of the endings outside the ellipse, all of them in sight in both panels."""
    scene = explorers.Endings()
    scene.update(time=20, slip=8, turn=0.0)
    assert 0.48 < scene.frames[20, 8, 0.0][-2] < 0.56
    for ax, line in ((scene.left, scene.lines[1]), (scene.right, scene.lines[2])):
        (x0, x1), (y0, y1), (x, y) = ax.get_xlim(), ax.get_ylim(), line.get_data()
        assert x0 < x.min() and x.max() < x1 and y0 < y.min() and y.max() < y1
    assert np.ptp(scene.lines[2].get_xdata()) > 0.5  # m: the bend, five times the ellipse's width


def test_reckoning_is_honest_over_short_drives():
    """200 endings of the linear model, 5 m on a circle: mean NEES within 4 standard errors of 3, false alarm 6e-5."""
    cloud, mean, P = runs.endings(3, 0.6, [10.0], 1, runs=200)[10.0]
    values = [nees(Gaussian(mean, P), pose, pose_residual) for pose in cloud]
    assert abs(np.mean(values) - 3) < 4 * np.sqrt(6 / 200)


def test_one_step_of_reckoning_from_certainty_leaves_the_wheels_own_covariance():
    robot = Robot()
    pose, P = runs.reckon(np.zeros(3), np.zeros((3, 3)), np.array([0.5, 0.0]), robot, 0.05)
    assert pose == pytest.approx([0.025, 0, 0])
    M = robot.odometry_cov(0.5, 0.0, 0.05)
    assert P[0, 0] == pytest.approx(M[0, 0] * 0.05**2) and P[2, 2] == pytest.approx(M[1, 1] * 0.05**2)


def test_the_opening_questions_answer_agrees_with_the_closed_form():
    """Mean of |y| for y of σ = D σ_θ / √3, to first order; 10,000 runs leave 2 % at 3 standard errors."""
    sigma_theta = np.sqrt(Robot(slip=0.08).odometry_cov(0.5, 0.0, 0.05)[1, 1]) * 0.05 * np.sqrt(400)
    assert np.hypot(*(runs.ways(10_000) - [10, 0]).T).mean() == pytest.approx(
        np.sqrt(2 / np.pi) * 10 * sigma_theta / np.sqrt(3), rel=0.03
    )


def test_the_drawing_of_the_arc_has_every_symbol_of_its_derivation():
    said = " ".join(text.get_text() for text in figures.arc_and_chord().axes[0].texts)
    for symbol in (
        "$v_l$",
        "$v_r$",
        "$b$",
        r"\Delta s = v\,\Delta t",
        r"chord $\Delta c$",
        r"$\frac{1}{2}\Delta\theta$",
    ):
        assert symbol in said


@pytest.mark.parametrize(("turn", "shape"), [(0.0, "a banana"), (0.6, "ellipse")])
def test_the_text_may_read_the_shape_that_the_picture_has(endings, turn, shape):
    place = {"time": 20, "slip": 8, "turn": turn}
    told = endings.facts(**place)["shape"]
    assert shape in told and f"has the shape of {told}." in endings.words(**place)


@pytest.fixture(scope="module")
def endings():
    return explorers.Endings()
