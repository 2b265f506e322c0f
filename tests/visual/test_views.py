"""Views fitted to pairs: straight down with four parameters, tilted with eight, and what their covariances promise."""

import numpy as np
import pytest

from coursekit.gaussian import chi2_band
from coursekit.visual.homography import fit_homography, jacobian, project
from coursekit.visual.similarity import fit_similarity
from coursekit.visual.views import likelier


def scattered(rng, n):
    source = rng.uniform(-200, 200, (n, 2))
    a, b, x, y = truth = np.array([0.9, -0.5, 700.0, 300.0])
    return source, source @ np.array([[a, -b], [b, a]]).T + [x, y], truth


def test_a_similarity_is_recovered_exactly_from_exact_pairs():
    source, target, truth = scattered(np.random.default_rng(0), 30)
    parameters, _, rms = fit_similarity(source, target)
    assert parameters == pytest.approx(truth, abs=1e-9) and rms < 1e-9


def test_wrong_pairs_inside_the_gate_hardly_move_the_fit():
    rng = np.random.default_rng(1)
    source, target, truth = scattered(rng, 60)
    target += 0.2 * rng.standard_normal(target.shape)
    target[:9] += [2.0, 0.0]  # all to the same side: a mean would follow them by 0.3 px
    parameters, _, _ = fit_similarity(source, target)
    assert abs(parameters[2] - truth[2]) < 0.1


def test_the_covariance_is_the_one_that_t_distributed_residuals_leave():
    """400 fits: the average NEES of the four parameters within its 99.9 % band."""
    rng, nees = np.random.default_rng(2), []
    for _ in range(400):
        source, target, truth = scattered(rng, 60)
        target += 0.2 * rng.standard_normal((60, 2)) / np.sqrt(rng.chisquare(4, (60, 1)) / 4)
        parameters, cov, _ = fit_similarity(source, target)
        nees.append((parameters - truth) @ np.linalg.solve(cov, parameters - truth))
    low, high = chi2_band(4, runs=400, confidence=0.999)
    assert low < np.mean(nees) < high * 1.05  # the information is the large-sample one; 60 pairs are nearly that


def test_a_few_pairs_are_charged_for_the_four_parameters_that_they_pay_for():
    """Pairs that are given twice have the same residuals and twice the information.  2n numbers less 4 parameters are
    what the residuals' variance is worth, so the covariance falls to ½ (2n - 4)/(2n - 2), and not to a half."""
    rng = np.random.default_rng(3)
    source, target, _ = scattered(rng, 6)
    target += 0.2 * rng.standard_normal((6, 2))
    once, twice = fit_similarity(source, target)[1], fit_similarity(np.tile(source, (2, 1)), np.tile(target, (2, 1)))[1]
    assert twice == pytest.approx(0.5 * (6 - 2) / (6 - 1) * once, rel=1e-6)


def test_twelve_pairs_are_enough_for_an_honest_covariance():
    """1,000 fits.  With a variance from 20 degrees of freedom the mean NEES of four parameters is 4 · 20/18 = 4.4, and
    4.7 with tails that heavy; standard error 0.12.  Without the charge it would be 5.7."""
    rng, nees = np.random.default_rng(4), []
    for _ in range(1000):
        source, target, truth = scattered(rng, 12)
        target += 0.2 * rng.standard_normal((12, 2)) / np.sqrt(rng.chisquare(4, (12, 1)) / 4)
        parameters, cov, _ = fit_similarity(source, target)
        nees.append((parameters - truth) @ np.linalg.solve(cov, parameters - truth))
    assert 4.2 < np.mean(nees) < 5.2


TILTED = np.array([[0.9, -0.3, 700.0], [0.4, 0.7, 300.0], [4e-4, -6e-4, 1.0]])


def test_a_homography_is_recovered_exactly_from_exact_pairs_and_with_it_its_centres_pose():
    source, centre = np.random.default_rng(0).uniform(0, 400, (30, 2)), np.array([199.5, 149.5])
    rough = TILTED + np.array([[0.01, -0.01, 3], [0.02, 0.0, -2], [1e-5, 0, 0]])
    H, pose, _ = fit_homography(rough, centre, source, project(TILTED, source))
    np.testing.assert_allclose(H, TILTED, rtol=1e-6)
    J = jacobian(TILTED, centre)
    U, (long, short), Vt = np.linalg.svd(J)
    nearest_turn = U @ Vt
    assert pose[:2] == pytest.approx(project(TILTED, centre[None])[0])
    assert pose[2] == pytest.approx(np.arctan2(nearest_turn[1, 0], nearest_turn[0, 0]))
    assert pose[3] == pytest.approx(np.sqrt(long * short))


def test_the_covariance_of_a_tilted_pose_is_the_one_that_its_residuals_leave():
    """400 fits to 60 pairs: the average NEES of [x, y, yaw, scale] within its 99.9 % band, a twentieth more for 60."""
    rng, nees, centre = np.random.default_rng(5), [], np.array([199.5, 149.5])
    truth = fit_homography(TILTED, centre, s := rng.uniform(0, 400, (60, 2)), project(TILTED, s))[1]
    for _ in range(400):
        source = rng.uniform(0, 400, (60, 2))
        noise = 0.2 * rng.standard_normal((60, 2)) / np.sqrt(rng.chisquare(4, (60, 1)) / 4)
        _, pose, cov = fit_homography(TILTED, centre, source, project(TILTED, source) + noise)
        nees.append((pose - truth) @ np.linalg.solve(cov, pose - truth))
    low, high = chi2_band(4, runs=400, confidence=0.999)
    assert low < np.mean(nees) < high * 1.05


def test_a_homography_is_charged_for_eight_parameters():
    rng = np.random.default_rng(3)
    source, centre = rng.uniform(0, 400, (9, 2)), np.array([199.5, 149.5])
    target = project(TILTED, source) + 0.2 * rng.standard_normal((9, 2))
    pairs = [(np.tile(source, (k, 1)), np.tile(target, (k, 1))) for k in (1, 2)]
    once, twice = (fit_homography(TILTED, centre, *both)[2] for both in pairs)
    assert twice == pytest.approx(0.5 * (9 - 4) / (9 - 2) * once, rel=1e-6)


def test_pairs_on_one_line_show_no_tilt():
    on_line = np.column_stack([np.linspace(0, 400, 20)] * 2)
    view = likelier(np.hstack([on_line, on_line + np.array([30.0, 40.0])]), np.array([200.0, 200.0]), np.eye(3))
    assert not view.tilted and view.pose == pytest.approx([230, 240, 0, 1])


def test_the_jacobian_of_a_homography_agrees_with_finite_differences():
    homography = np.array([[1.1, -0.2, 30], [0.3, 0.9, 20], [1e-4, -2e-4, 1]])
    point, h = np.array([120.0, 80.0]), 1e-5
    numeric = [(project(homography, (point + d)[None]) - project(homography, (point - d)[None]))[0] / (2 * h)
               for d in h * np.eye(2)]  # fmt: skip
    assert jacobian(homography, point) == pytest.approx(np.array(numeric).T, rel=1e-6)
