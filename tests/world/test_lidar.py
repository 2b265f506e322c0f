import numpy as np
import pymunk
import pytest

from coursekit.geometry import transform
from coursekit.recordings.datasets import project_file
from coursekit.world.arena import Arena, Crate, Cylinder, Wall
from coursekit.world.lidar import Lidar, Scan, cast
from coursekit.world.robot import OBSTACLE, World

NAMES = sorted(path.stem for path in project_file("arenas").glob("*.toml"))
ROOM = tuple(Wall(a, b) for a, b in [((-4, -3), (5, -3)), ((5, -3), (5, 3)), ((5, 3), (-4, 3)), ((-4, 3), (-4, -3))])


def pymunk_ranges(world, lidar, pose):
    """The same scan by asking pymunk beam by beam; the mask leaves out the robot's own disc."""
    x, y, heading = (float(value) for value in pose)
    obstacles = pymunk.ShapeFilter(mask=OBSTACLE)
    ranges = np.full(lidar.beams, np.inf)
    for i, angle in enumerate(heading + lidar.angles):
        end = (x + lidar.max_range * np.cos(angle), y + lidar.max_range * np.sin(angle))
        hit = world.space.segment_query_first((x, y), end, 0.0, obstacles)
        if hit is not None:
            ranges[i] = hit.alpha * lidar.max_range
    return ranges


def is_free(arena, crates, pose):
    """Outside every cylinder and crate: pymunk has nothing to say about a view from inside."""
    x = np.asarray(pose[:2])
    outside = all(np.hypot(*(x - c.position)) > c.radius + 0.01 for c in arena.cylinders)
    return outside and all(
        np.hypot(*(x - p[:2])) > np.hypot(*c.size) for c, p in zip(arena.crates, crates, strict=True)
    )


@pytest.mark.parametrize("name", NAMES)
def test_scans_agree_with_pymunk_to_a_billionth_with_the_crates_where_they_were_pushed(name):
    rng = np.random.default_rng(7)
    world = World(Arena.load(name), 1)
    lidar = Lidar(max_range=80.0)
    for k in range(60):
        world.step(0.6, 0.8 * np.sin(k / 9))
    corners = np.array([p for w in world.arena.walls for p in (w.start, w.end)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    compared = 0
    for pose in [world.pose, *np.column_stack([rng.uniform(low, high, (24, 2)), rng.uniform(-4, 4, 24)])]:
        if is_free(world.arena, world.crates, pose):
            ours, theirs = lidar.scan(world, pose=pose).ranges, pymunk_ranges(world, lidar, pose)
            assert np.array_equal(np.isfinite(ours), np.isfinite(theirs))
            hit = np.isfinite(ours)
            assert np.abs(ours[hit] - theirs[hit]).max() < 1e-9
            compared += hit.sum()
    assert compared > 4000


def test_scans_agree_with_pymunk_among_many_random_things():
    rng = np.random.default_rng(8)
    for _ in range(6):
        spots = rng.uniform(-9, 9, (30, 2))
        spots = spots[np.hypot(*spots.T) > 1.5]
        arena = Arena(
            "random",
            walls=tuple(Wall(p, p + rng.uniform(0.5, 1, 2)) for p in spots[:8]),
            cylinders=tuple(Cylinder(p, rng.uniform(0.05, 0.5)) for p in spots[8:16]),
            crates=tuple(Crate((*p, rng.uniform(-3, 3)), rng.uniform(0.1, 1.0, 2)) for p in spots[16:]),
        )
        world, lidar = World(arena, 0), Lidar(beams=1000, max_range=25.0)
        ours, theirs = lidar.scan(world).ranges, pymunk_ranges(world, lidar, world.pose)
        hit = np.isfinite(theirs)
        assert np.array_equal(np.isfinite(ours), hit) and 200 < hit.sum() < 1000
        assert np.abs(ours[hit] - theirs[hit]).max() < 1e-9


def test_no_beam_slips_out_of_a_closed_room_even_through_its_corners():
    arena = Arena("room", walls=ROOM)
    rng = np.random.default_rng(9)
    corners = np.array([w.start for w in ROOM])
    for origin in rng.uniform((-3.9, -2.9), (4.9, 2.9), (300, 2)):
        exactly = np.arctan2(*(corners - origin).T[::-1])
        starts, ends = corners, np.array([w.end for w in ROOM])
        ranges = cast(origin, exactly, starts, ends, np.zeros((0, 2)), np.zeros(0))
        assert ranges == pytest.approx(np.hypot(*(corners - origin).T), abs=1e-9)
    assert np.all(np.isfinite(Lidar(max_range=20).scan(arena).ranges))


def test_beams_run_counter_clockwise_with_the_robots_ahead_at_zero():
    arena = Arena("left", cylinders=(Cylinder((0.0, 2.0), 0.1),))
    scan = Lidar().scan(arena)
    assert scan.angles[np.argmin(scan.ranges)] == pytest.approx(np.pi / 2)
    assert scan.ranges.min() == pytest.approx(1.9)
    turned = Lidar().scan(arena, pose=(0, 0, np.pi / 2))
    assert turned.angles[np.argmin(turned.ranges)] == pytest.approx(0.0, abs=1e-12)
    assert scan.angles[-1] == pytest.approx(np.pi) and np.diff(scan.angles) == pytest.approx(np.pi / 180)


def test_points_in_the_robots_frame_land_on_the_walls_in_the_world():
    arena, pose = Arena("room", walls=ROOM), np.array([1.0, -0.5, 0.7])
    points = transform(pose, Lidar(max_range=20).scan(arena, pose=pose).points())
    assert points.shape == (360, 2)
    off_x = np.minimum(np.abs(points[:, 0] + 4), np.abs(points[:, 0] - 5))
    off_y = np.abs(np.abs(points[:, 1]) - 3)
    assert np.minimum(off_x, off_y).max() < 1e-9


def test_what_is_out_of_reach_reads_infinity_and_leaves_no_point():
    scan = Lidar(max_range=3.5).scan(Arena("room", walls=ROOM), np.random.default_rng(0))
    assert np.isposinf(scan.ranges).any() and not np.isnan(scan.ranges).any()
    assert len(scan.points()) == np.isfinite(scan.ranges).sum() < 360
    nothing = Lidar().scan(Arena("void"))
    assert np.all(np.isposinf(nothing.ranges)) and nothing.points().shape == (0, 2)


def test_noise_has_the_spread_it_was_given_and_no_bias():
    """300 scans of 360 beams: mean and spread within 4 standard errors, false alarm below 2e-4."""
    lidar, rng = Lidar(sigma=0.02, max_range=20), np.random.default_rng(1)
    arena = Arena("room", walls=ROOM)
    exact = lidar.scan(arena).ranges
    noise = np.array([lidar.scan(arena, rng).ranges - exact for _ in range(300)])
    assert abs(noise.mean()) < 4 * 0.02 / np.sqrt(noise.size)
    assert abs(noise.std() / 0.02 - 1) < 4 / np.sqrt(2 * noise.size)
    assert np.array_equal(lidar.scan(arena).ranges, exact)


def test_noise_never_makes_a_range_negative():
    arena = Arena("close", walls=(Wall((0.001, -1), (0.001, 1)),))
    scan = Lidar(sigma=0.1).scan(arena, np.random.default_rng(0))
    assert scan.ranges.min() == 0.0


def test_a_scan_sees_a_crate_move():
    world = World(Arena("crate", crates=(Crate((1.0, 0.0, 0.0), (0.4, 0.4), 0.5),)), 0)
    before = Lidar().scan(world, pose=(0, 0, 0)).ranges[179]
    for _ in range(120):
        world.step(0.4, 0.0)
    after = Lidar().scan(world, pose=(0, 0, 0)).ranges[179]
    assert before == pytest.approx(0.8) and after == pytest.approx(world.crates[0, 0] - 0.2, abs=1e-3)
    assert after > before + 0.3


def test_settings_and_poses_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match="beams"):
        Lidar(beams=0)
    for beams in (2.5, np.nan, True):
        with pytest.raises(ValueError, match="beams: expected a whole number"):
            Lidar(beams=beams)
    with pytest.raises(TypeError, match="beams: expected real numbers"):
        Lidar(beams="many")
    assert Lidar(max_range=np.inf).scan(Arena("void")).ranges[0] == np.inf
    with pytest.raises(ValueError, match="max_range"):
        Lidar(max_range=np.nan)
    with pytest.raises(ValueError, match="sigma"):
        Lidar(sigma=np.nan)
    with pytest.raises(TypeError, match=r"expected a World or an Arena, got 'lab'; Arena.load\('lab'\)"):
        Lidar().scan("lab")
    for pose in [(0, 0), (0, np.nan, 0)]:
        with pytest.raises(ValueError, match="pose"):
            Lidar().scan(Arena("void"), pose=pose)


def test_a_scan_is_a_plain_pair_of_arrays():
    scan = Scan(np.array([0.0, np.pi / 2]), np.array([2.0, 3.0]))
    assert scan.points() == pytest.approx(np.array([[2.0, 0.0], [0.0, 3.0]]), abs=1e-12)


@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 2, 2.0, -2.9])
@pytest.mark.parametrize("backwards", [False, True])
def test_a_beam_along_a_wall_meets_its_nearer_end(turn, backwards):
    """The wall from 1 m to 3 m ahead, as seen end on; behind the robot it is not met, and from on it the range is 0."""
    ends = transform([0.4, -0.7, turn], np.array([[1.0, 0.0], [3.0, 0.0]]))
    arena = Arena("edge", walls=(Wall(*(ends[::-1] if backwards else ends)),))

    def ahead(distance):
        here = transform([0.4, -0.7, turn], np.array([distance, 0.0]))
        return Lidar(beams=2).scan(arena, pose=[*here, turn]).ranges

    assert ahead(0.0) == pytest.approx([1.0, np.inf])
    assert ahead(4.0) == pytest.approx([np.inf, 1.0])
    assert ahead(2.0) == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_beam_beside_a_wall_and_parallel_to_it_meets_nothing():
    arena = Arena("beside", walls=(Wall((1, 1e-6), (3, 1e-6)),))
    assert np.all(np.isposinf(Lidar(beams=2).scan(arena).ranges))


def test_no_range_is_minus_zero():
    rng = np.random.default_rng(3)
    arena = Arena("here", walls=(Wall((0, -1), (0, 1)), Wall((-1, 0), (1, 0))), cylinders=(Cylinder((0.1, 0)),))
    for scan in (Lidar().scan(arena), Lidar(sigma=0.5).scan(arena, rng)):
        assert scan.ranges.min() == 0 and not np.signbit(scan.ranges).any()
