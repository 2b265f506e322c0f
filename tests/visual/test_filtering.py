"""The visual filter: starved and cured, honest when it is blind, not fooled by one wrong match."""

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from coursekit import particles
from coursekit.gaussian import Gaussian, mahalanobis_squared
from coursekit.geometry import wrap_angle
from coursekit.models import DifferentialDrive, pose_residual
from coursekit.particles import Particles, effective_sample_size, weigh
from coursekit.results import Rejected
from coursekit.visual import (
    DirectMatcher,
    MapMatcher,
    VisualFilter,
    calibrate,
    dominant_cluster,
    follow,
    heaviest,
    inflated,
    log_likelihood,
    log_prediction,
    mean,
    odometry_from_image,
)
from coursekit.visual._fast_prediction import log_prediction_near
from coursekit.visual.filtering import REPORT_SPREAD
from coursekit.world.seafloor import DT, dive

MAP = (800, 2560)
MOTION = DifferentialDrive(4.0, 0.05, (0.4, 0.4, 1e-3))
CONTROL = np.array([20.0, 0.1])
SHARP = np.diag([0.02**2, 0.02**2, 1e-4**2])
BLIND = Rejected("blackout")


def visual(**settings):
    return VisualFilter(MAP, MOTION, **settings)


def at(pose, n=1000, spread=(0.02, 0.02, 1e-4), seed=0):
    rng = np.random.default_rng(seed)
    return Particles(np.asarray(pose) + rng.standard_normal((n, 3)) * spread, angles=(2,))


def swim(rng, steps, start=(800.0, -400.0, 0.3)):
    """A robot that really moves as the model says: controls and poses."""
    controls = np.column_stack([np.full(steps, 20.0), rng.uniform(-0.3, 0.3, steps)])
    poses = [np.array(start)]
    for u in controls:
        poses.append(MOTION.sample(poses[-1][None], u, DT, rng)[0])
    return controls, np.array(poses[1:])


def seen(pose, rng, cov=SHARP):
    error = np.linalg.cholesky(cov) @ rng.standard_normal(3)
    return Gaussian(np.append((pose + error)[:2], wrap_angle(pose[2] + error[2])), cov)


def off(cloud, pose):
    return float(np.hypot(*(dominant_cluster(cloud).mean - pose)[:2]))


# --- likelihoods -------------------------------------------------------------------------------------------------


def test_the_likelihood_is_the_normal_density_with_the_heading_wrapped():
    fix = Gaussian(np.array([10.0, 20.0, np.pi - 0.05]), np.diag([4.0, 9.0, 0.01]))
    states = np.array([[11.0, 18.0, np.pi - 0.15], [11.0, 18.0, -np.pi + 0.05]])
    expected = multivariate_normal(np.zeros(3), fix.cov).logpdf([[1.0, -2.0, -0.1], [1.0, -2.0, 0.1]])
    assert log_likelihood(fix)(states) == pytest.approx(expected)


def test_a_robust_likelihood_doubts_what_is_far_and_keeps_what_is_near():
    fix, volume = Gaussian(np.zeros(3), np.diag([1.0, 1.0, 0.01])), 1e7
    trusting, doubting = log_likelihood(fix), log_likelihood(fix, outlier=0.02, volume=volume)
    states = np.array([[0.0, 0, 0], [500.0, 0, 0]])
    assert doubting(states)[0] == pytest.approx(trusting(states)[0] + np.log(0.98), abs=1e-4)
    assert doubting(states)[1] == pytest.approx(np.log(0.02 / volume)) and trusting(states)[1] < -1e5


def test_inflating_keeps_the_place_and_takes_the_reports_spreads():
    fix = inflated(Gaussian([1.0, 2.0, 3.0], SHARP))
    assert np.array_equal(fix.mean, [1, 2, 3]) and np.sqrt(np.diag(fix.cov)) == pytest.approx(REPORT_SPREAD)


@pytest.mark.parametrize("arguments", [{"outlier": -0.1}, {"outlier": 1.0}, {"outlier": np.nan}, {"volume": 0.0}])
def test_a_likelihood_that_makes_no_sense_is_refused(arguments):
    with pytest.raises(ValueError, match="outlier"):
        log_likelihood(Gaussian(np.zeros(3), np.eye(3)), **arguments)


# --- starved, and cured ------------------------------------------------------------------------------------------


def test_a_sensor_that_is_too_good_starves_a_plain_filter_and_not_this_one():
    """20 steps from the same start: ESS of 1,000 particles, and how far from the truth they put the robot."""
    rng = np.random.default_rng(5)
    controls, poses = swim(rng, 20)
    plain = mixed = at([800, -400, 0.3])
    ess, error = {"plain": [], "mixed": []}, {"plain": [], "mixed": []}
    for u, pose in zip(controls, poses, strict=True):
        fix = seen(pose, rng)
        plain = weigh(particles.predict(particles.resample(plain, rng), MOTION, u, DT, rng), log_likelihood(fix))
        mixed = visual().step(mixed, u, DT, fix, rng)
        for name, cloud in [("plain", plain), ("mixed", mixed)]:
            ess[name].append(effective_sample_size(cloud.weights))
            error[name].append(off(cloud, pose))
    assert np.median(ess["plain"]) < 1.5 and np.median(ess["mixed"]) > 200
    assert np.median(error["mixed"]) < 0.04 < 0.1 < np.median(error["plain"])


def test_the_mixed_cloud_is_the_product_of_prediction_and_fix():
    """Where both are Gaussian the answer is known: P⁻¹ = Q⁻¹ + Σ⁻¹.  Averaged over 30 clouds of 1,000."""
    start, cov = np.array([800.0, -400.0, 0.0]), np.diag([1.5**2, 1.0**2, 0.02**2])
    ahead, noise = MOTION.f(start, CONTROL, DT), MOTION.Q(start, CONTROL, DT)
    fix = Gaussian(ahead + np.array([1.5, -1.0, 0.02]), cov)
    gain = np.linalg.solve(noise + cov, noise).T
    expected = Gaussian(ahead + gain @ (fix.mean - ahead), noise - gain @ noise)
    clouds = [visual().step(at(start, spread=(0, 0, 0)), CONTROL, DT, fix, np.random.default_rng(k)) for k in range(30)]
    means = np.array([particles.mean(c) for c in clouds])
    sigma = np.sqrt(np.diag(expected.cov))
    assert np.all(np.abs(means.mean(axis=0) - expected.mean) < 0.03 * sigma)
    covs = np.mean([particles.covariance(c) for c in clouds], axis=0)
    assert covs / np.outer(sigma, sigma) == pytest.approx(expected.cov / np.outer(sigma, sigma), abs=0.06)


@pytest.mark.parametrize("heading", [0.0, 2.2, np.pi])
def test_the_prediction_of_a_cloud_of_copies_is_the_models_own_density(heading):
    start = np.array([800.0, -400.0, heading])
    ahead, noise = MOTION.f(start, CONTROL, DT), MOTION.Q(start, CONTROL, DT)
    points = ahead + np.array([[0, 0, 0], [2.0, -1.0, 0.02], [-3.0, 2.0, -0.03]])
    found = log_prediction(points, at(start, n=7, spread=(0, 0, 0)), MOTION, CONTROL, DT)
    assert found == pytest.approx(multivariate_normal(np.zeros(3), noise).logpdf(pose_residual(points, ahead)))


@pytest.mark.parametrize("heading", [0.3, np.pi])
def test_the_prediction_of_a_cloud_is_the_density_that_its_samples_have(heading):
    """How many of 300,000 moved particles land in a small box, against p(x) times its volume: within 5 σ."""
    rng = np.random.default_rng(6)
    weights = np.array([0.5, 0.3, 0.2])
    cloud = Particles(np.array([800.0, -400.0, heading]) + rng.standard_normal((3, 3)) * [4, 4, 0.05], np.log(weights),
                      angles=(2,))  # fmt: skip
    many = Particles(cloud.states[rng.choice(3, 300_000, p=weights)], angles=(2,))
    moved = particles.predict(many, MOTION, CONTROL, DT, rng)
    x, box = MOTION.f(cloud.states[0], CONTROL, DT), np.array([0.5, 0.5, 0.01])
    share = np.mean(np.all(np.abs(pose_residual(moved.states, x)) < box / 2, axis=1))
    grid = np.stack(np.meshgrid(*[b * (np.arange(5) - 2) / 5 for b in box]), axis=-1).reshape(-1, 3)
    expected = np.exp(log_prediction(x + grid, cloud, MOTION, CONTROL, DT)).mean() * box.prod()
    assert abs(share - expected) < 5 * np.sqrt(expected / 300_000)


@pytest.mark.parametrize("heading", [0.3, np.pi])
def test_the_fast_prediction_near_a_fix_is_the_plain_sum(heading):
    rng = np.random.default_rng(7)
    cloud = Particles(np.array([800.0, -400.0, heading]) + rng.standard_normal((200, 3)) * [3, 3, 0.1],
                      rng.standard_normal(200), angles=(2,))  # fmt: skip
    fix = Gaussian(MOTION.f(cloud.states[0], CONTROL, DT), SHARP)
    points = fix.sample(rng, 50)
    found = log_prediction_near(fix, points, cloud, MOTION, CONTROL, DT)
    assert found == pytest.approx(log_prediction(points, cloud, MOTION, CONTROL, DT), abs=1e-8)
    far = np.array([900.0, 0, 0])
    assert np.all(
        log_prediction_near(Gaussian(fix.mean + far, SHARP), points + far, cloud, MOTION, CONTROL, DT) == -np.inf
    )


# --- lost, carried off, misled, blind ----------------------------------------------------------------------------


def test_from_anywhere_on_the_map_it_is_located_within_three_fixes_in_fifty_of_fifty_runs():
    for seed in range(50):
        rng = np.random.default_rng(seed)
        controls, poses = swim(rng, 3)
        *_, last = follow(visual(), visual().uniform(1000, rng), controls, DT, [seen(p, rng) for p in poses], rng)
        assert off(last, poses[-1]) < 0.5


def test_after_a_kidnapping_it_is_back_within_ten_fixes_in_fifty_of_fifty_runs():
    for seed in range(50):
        rng = np.random.default_rng(100 + seed)
        elsewhere = np.append(rng.uniform([300, -500], [2200, -300]), rng.uniform(-np.pi, np.pi))
        controls, poses = swim(rng, 10, start=elsewhere)
        clouds = follow(visual(), at([800, -400, 0.3], 400), controls, DT, [seen(p, rng) for p in poses], rng)
        assert min(off(c, p) for c, p in zip(clouds, poses, strict=True)) < 0.5


def test_one_wrong_match_is_doubted_and_a_second_that_agrees_with_it_is_believed():
    rng = np.random.default_rng(1)
    controls, poses = swim(rng, 6)
    wrong_poses = poses + np.array([900.0, 60.0, 0.0])
    cloud, errors = at([800, -400, 0.3]), []
    for k in range(6):
        believed = wrong_poses[k] if k in (1, 4, 5) else poses[k]
        cloud = visual().step(cloud, controls[k], DT, seen(believed, rng), rng)
        errors.append(off(cloud, poses[k]))
    assert errors[1] < 12 and errors[2] < 0.2  # doubted: carried by the motion for one step
    assert errors[4] < 12 and errors[5] > 500  # two that agree are a kidnapping, as far as anyone can tell


def test_scattered_wrong_matches_never_carry_it_off():
    rng = np.random.default_rng(2)
    controls, poses = swim(rng, 60)
    fixes = [seen(p if rng.random() > 0.15 else visual().uniform(1, rng).states[0], rng) for p in poses]
    clouds = follow(visual(), at([800, -400, 0.3]), controls, DT, fixes, rng)
    errors = np.array([off(c, p) for c, p in zip(clouds, poses, strict=True)])
    wrong = np.array([np.hypot(*(f.mean - p)[:2]) > 5 for f, p in zip(fixes, poses, strict=True)])
    assert 4 < wrong.sum() < 20
    assert np.median(errors[~wrong]) < 0.05 and errors.max() < 40


def test_blind_it_grows_uncertain_and_the_truth_stays_inside():
    """15 dives of 25 blind steps; 375 correlated answers, 90 to 100 % inside the 95 % ellipse."""
    inside, sizes = [], []
    for seed in range(15):
        rng = np.random.default_rng(seed)
        controls, poses = swim(rng, 25)
        clouds = list(follow(visual(), at([800, -400, 0.3], 500), controls, DT, [BLIND] * 25, rng))
        for cloud, pose in zip(clouds, poses, strict=True):
            belief = dominant_cluster(cloud)
            distance = mahalanobis_squared((pose - belief.mean)[:2], belief.cov[:2, :2])
            inside.append(distance < chi2.ppf(0.95, 2))
        sizes.append(
            [np.sqrt(np.linalg.det(dominant_cluster(c).cov[:2, :2])) for c in (clouds[0], clouds[9], clouds[24])]
        )
    assert np.all(np.diff(sizes, axis=1) > 0) and np.mean(sizes, axis=0)[2] > 20 * np.mean(sizes, axis=0)[0]
    assert 0.90 <= np.mean(inside) <= 1.0


def test_with_a_direct_matcher_it_sees_where_features_fail(sea, matcher):
    """Murky water over rocks: every fix is rejected, and the picture as a whole still tells."""
    murky = dive(sea, 25, 7, start=[600, 420, 1.3], targets=[[1000, 380]], blur=8.0)
    poses = odometry_from_image(murky.poses)
    frames = [murky.frame(k) for k in range(1, 26)]
    fixes = [matcher.locate(frame) for frame in frames]
    assert sum(map(bool, fixes)) <= 2
    calibrated = calibrate(odometry_from_image(dive(sea, 200, 1).poses), dive(sea, 200, 1).commands, DT)
    worst = {}
    for name, direct in [("blind", None), ("direct", DirectMatcher(sea))]:
        rng, cloud, errors = np.random.default_rng(0), at(poses[0], 500, (3, 3, 0.03)), []
        robot = VisualFilter(MAP, calibrated.motion, direct=direct)
        for k, frame in enumerate(frames):
            cloud = robot.step(cloud, calibrated.control(murky.commands[k]), DT, BLIND, rng, image=frame)
            errors.append(off(cloud, poses[k + 1]))
        worst[name] = np.max(errors[5:])
    assert worst["direct"] < 6


# --- estimates ---------------------------------------------------------------------------------------------------


def test_between_two_places_the_mean_is_where_the_robot_surely_is_not():
    two = np.vstack([at([300, -400, 1.0], 600, (3, 3, 0.1)).states, at([2000, -400, 1.0], 400, (3, 3, 0.1)).states])
    cloud = Particles(two, angles=(2,))
    assert dominant_cluster(cloud).mean[:2] == pytest.approx([300, -400], abs=1)
    assert abs(mean(cloud).mean[0] - 300) > 500 and abs(mean(cloud).mean[0] - 2000) > 500
    assert dominant_cluster(cloud).cov[0, 0] == pytest.approx(9, rel=0.2)


def test_the_dominant_cluster_of_one_cluster_is_its_mean_however_wide_it_is():
    cloud = at([1000, -400, 3.1], 2000, (60, 30, 0.2))
    assert dominant_cluster(cloud).mean == pytest.approx(mean(cloud).mean, abs=2)
    assert dominant_cluster(cloud).cov[0, 0] == pytest.approx(3600, rel=0.1)


def test_between_two_clusters_far_apart_the_dominant_one_needs_no_more_memory():
    states = np.vstack([at([0, 0, 0], n=20).states, at([1e9, -1e9, 1.0], n=30).states])
    assert dominant_cluster(Particles(states, angles=(2,))).mean == pytest.approx([1e9, -1e9, 1.0], abs=0.1)


def test_after_resampling_the_greatest_weight_is_an_arbitrary_particle():
    rng = np.random.default_rng(0)
    cloud = at([1000, -400, 0], 1000, (5, 5, 0.1))
    fix = inflated(Gaussian([1000.0, -400.0, 0.0], SHARP), [2, 2, 0.1])
    weighed = weigh(cloud, log_likelihood(fix))
    assert np.hypot(*(heaviest(weighed) - fix.mean)[:2]) < 1
    # all weigh the same now: the first in line is as good as any other, and as bad
    equal = particles.resample(weighed, rng)
    assert np.array_equal(heaviest(equal), equal.states[0])


def test_copies_of_one_particle_still_have_a_covariance_to_divide_by():
    for belief in (dominant_cluster(copies := Particles(np.tile([5.0, 6.0, 0.1], (10, 1)), angles=(2,))), mean(copies)):
        assert np.sqrt(np.diag(belief.cov)) == pytest.approx([1e-3, 1e-3, 1e-5], rel=1e-3)


def test_a_cloud_on_a_line_of_the_maps_length_has_a_covariance_with_a_margin():
    t = np.linspace(-1e7, 1e7, 500)
    belief = mean(Particles(np.stack([t, 2 * t, np.zeros(500)], axis=1), angles=(2,)))
    scale = np.sqrt(np.diag(belief.cov))
    found = np.linalg.eigvalsh(belief.cov / np.outer(scale, scale))
    assert found[0] / found[-1] > 0.9e-12


def test_of_two_clusters_that_weigh_the_same_the_first_is_dominant_however_their_sums_are_rounded():
    for n in (7, 30, 99, 100, 300):
        here, there = at([300, -400, 1.0], n, (3, 3, 0.1)).states, at([2000, -400, 1.0], n, (3, 3, 0.1)).states
        weights = np.random.default_rng(n).uniform(0.5, 1.5, n)
        for states, log_weights in (
            (np.vstack([here, there]), np.log(np.r_[weights, weights[::-1]])),
            (np.vstack([there, here]), np.log(np.r_[weights[::-1], weights])),
        ):
            assert dominant_cluster(Particles(states, log_weights, angles=(2,))).mean[0] == pytest.approx(300, abs=10)


# --- bad input ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 3, 10])
def test_a_few_particles_are_enough_to_run(n):
    rng = np.random.default_rng(0)
    cloud = visual().uniform(n, rng)
    for _ in range(3):
        cloud = visual().step(cloud, CONTROL, DT, Gaussian([500.0, -400.0, 0.0], SHARP), rng)
    assert len(cloud) == n and np.isfinite(dominant_cluster(cloud).mean).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: visual().uniform(0, np.random.default_rng(0)), "at least one particle"),
        (lambda: Particles(np.zeros((0, 3))), "at least one particle"),
        (lambda: Particles(np.zeros((2, 3)), [np.nan, 0.0]), "log_weights"),
        (lambda: Particles(np.zeros((2, 3)), [-np.inf, -np.inf]), "all zero"),
        (lambda: visual(share=0.0), "share"),
        (lambda: visual(share=1.0), "share"),
        (lambda: visual(outlier=np.nan), "outlier"),
        (lambda: visual(kidnap=-1.0), "kidnap"),
        (lambda: VisualFilter((800,), MOTION), "map_shape"),
        (lambda: VisualFilter((800, np.nan), MOTION), "map_shape"),
        (lambda: dominant_cluster(at([0, 0, 0]), cell=0), "cell"),
        (lambda: log_likelihood(Gaussian(np.zeros(2), np.eye(2))), "over 2 numbers"),
        (
            lambda: visual().step(at([0, 0, 0]), CONTROL, DT, Gaussian([0, 0], np.eye(2)), np.random.default_rng(0)),
            "over 2 numbers",
        ),
        (lambda: visual().step(at([0, 0, 0]), [np.nan, 0], DT, BLIND, np.random.default_rng(0)), "finite"),
        (lambda: Gaussian(np.zeros(3), -np.eye(3)), "positive definite"),
        (lambda: inflated(Gaussian(np.zeros(3), SHARP), [50, 50, 0]), "positive definite"),
        (lambda: inflated(Gaussian(np.zeros(3), SHARP), [50, np.nan, 1]), "finite"),
    ],
)
def test_settings_and_clouds_that_make_no_sense_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda rng: visual().step(at([0, 0, 0]), CONTROL, DT, None, rng), "measured: .* got NoneType"),
        (
            lambda rng: visual().step(np.zeros((9, 3)), CONTROL, DT, BLIND, rng),
            "cloud: expected Particles, got ndarray",
        ),
        (lambda rng: visual().step(at([0, 0, 0]), CONTROL, DT, BLIND, 7), "rng: expected a numpy.random.Generator"),
        (lambda rng: VisualFilter(MAP, DifferentialDrive), "the class DifferentialDrive itself"),
        (lambda rng: VisualFilter(None, MOTION), "map_shape"),
        (lambda rng: visual(share="a third"), "share: expected real numbers"),
        (lambda rng: visual(direct="yes"), "direct: expected a DirectMatcher"),
        (lambda rng: dominant_cluster(np.zeros((9, 3))), "cloud: expected Particles, got ndarray"),
        (lambda rng: mean((np.zeros((9, 3)), np.ones(9))), "cloud: expected Particles, got tuple"),
        (lambda rng: heaviest(None), "cloud: expected Particles, got NoneType"),
        (lambda rng: log_likelihood(np.zeros(3)), "fix: expected a Gaussian"),
        (lambda rng: inflated("the report's"), "fix: expected a Gaussian"),
        (lambda rng: log_prediction(np.zeros((1, 3)), np.zeros((9, 3)), MOTION, CONTROL, DT), "before: expected Part"),
        (lambda rng: odometry_from_image("north"), "pose: expected real numbers"),
        (lambda rng: calibrate("poses", "commands", 0.5), "poses: expected real numbers"),
    ],
)
def test_what_is_of_another_kind_gets_a_sentence(call, message):
    with pytest.raises(TypeError, match=message):
        call(np.random.default_rng(0))


def test_controls_and_measurements_must_come_in_pairs():
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"shorter|longer"):
        list(follow(visual(), at([0, 0, 0]), np.zeros((3, 2)) + 1.0, DT, [BLIND] * 2, rng))


def test_a_step_changes_nothing_that_it_was_given():
    cloud, rng = at([800, -400, 0.3]), np.random.default_rng(0)
    states, control = cloud.states.copy(), CONTROL.copy()
    visual().step(cloud, control, DT, Gaussian([810.0, -400.0, 0.3], SHARP), rng)
    assert np.array_equal(cloud.states, states) and np.array_equal(control, CONTROL)


# --- the acceptance run ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def crossing(sea, matcher):
    """A dive from rocks over bare sand to rocks, with fixes for every frame."""
    recorded = dive(sea, 75, 3, start=[800, 400, np.pi / 2], targets=[[1800, 400]])
    return recorded, [matcher.locate(recorded.frame(k)) for k in range(len(recorded))]


def test_with_a_thousand_particles_the_filter_is_no_worse_than_its_sensor(crossing):
    """One crossing here; 50 dives of 200 frames in benchmarks/visual.py --acceptance."""
    recorded, fixes = crossing
    poses, rng = odometry_from_image(recorded.poses), np.random.default_rng(0)
    matched = np.array([bool(f) for f in fixes])
    seen_poses = np.array([f.belief.mean if f else [np.nan] * 3 for f in fixes])
    calibrated = calibrate(seen_poses, recorded.commands, DT)
    robot = VisualFilter(MAP, calibrated.motion)
    controls = calibrated.control(recorded.commands)
    beliefs = [dominant_cluster(c) for c in follow(robot, robot.uniform(1000, rng), controls, DT, fixes[1:], rng)]
    error = pose_residual([b.mean for b in beliefs], poses[1:])
    sensor = pose_residual(seen_poses[1:], poses[1:])
    found, blind = matched[1:].copy(), ~matched[1:]
    found[:2] = False
    apart = np.hypot(*error[:, :2].T)
    assert 8 <= blind.sum() <= 45
    assert np.median(apart[found]) <= 1.1 * np.median(np.hypot(*sensor[found, :2].T)) < 0.1
    assert np.median(np.abs(error[found, 2])) < np.radians(0.02)
    inside = [mahalanobis_squared(e[:2], b.cov[:2, :2]) < chi2.ppf(0.95, 2) for e, b in zip(error, beliefs)]
    assert np.mean(np.array(inside)[2:]) >= 0.88 and np.mean(np.array(inside)[blind]) >= 0.85
    spread = np.array([np.sqrt(np.trace(b.cov[:2, :2])) for b in beliefs])
    assert spread[blind].max() > 100 * np.median(spread[found])


def test_a_matcher_for_one_map_does_not_find_the_robot_on_another(sea):
    from coursekit.world.seafloor_map import paint

    elsewhere = MapMatcher(paint(99, (800, 1200)))
    recorded = dive(sea, 4, 2, start=[500, 400, 0])
    assert not any(elsewhere.locate(recorded.frame(k)) for k in range(5))
