"""Clouds with a known motion between them, for the tests of ICP."""

from dataclasses import dataclass

import numpy as np

from coursekit import geometry, icp


def bumps(n, rng):
    """A lumpy closed surface of about a metre's radius, unlike itself turned round: (n, 3)."""
    x = rng.normal(size=(n, 3))
    x /= np.linalg.norm(x, axis=1)[:, None]
    r = 1 + 0.35 * np.sin(3 * x[:, 0] + 1) * np.cos(2 * x[:, 1]) + 0.4 * np.maximum(x[:, 2], 0) ** 2
    return x * (r + 0.25 * np.sin(4 * x[:, 1] * x[:, 2] + x[:, 0]))[:, None] * [1.2, 0.9, 0.6]


def room(n, rng):
    """Walls of 6 m × 4 m, a pillar and half a partition: (about 1.5 n, 2)."""
    s = rng.uniform(0, 20, n)
    sides = [s < 6, s < 10, s < 16]
    x = np.select(sides, [s, 6, 16 - s], 0)
    y = np.select(sides, [0, s - 6, 4], 20 - s)
    turn, along = rng.uniform(0, 2 * np.pi, n // 4), rng.uniform(2, 3.2, n // 4)
    pillar = np.array([1.5, 1.2]) + 0.3 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.vstack([np.stack([x, y], axis=1), pillar, np.stack([np.full_like(along, 3), along], axis=1)])


def corridor(n, rng, width=2.0, length=10.0):
    """Two parallel walls along x: (n, 2)."""
    return np.stack([rng.uniform(-length / 2, length / 2, n), width * (rng.integers(0, 2, n) - 0.5)], axis=1)


@dataclass(frozen=True)
class Problem:
    """Two clouds, the motion between them, and the size that errors are measured in."""

    source: np.ndarray
    target: np.ndarray
    T_target_source: np.ndarray
    size: float

    def error(self, T):
        """RMS distance of the source's points from where they belong, as a share of the clouds' size."""
        apart = icp.move(T, self.source) - icp.move(self.T_target_source, self.source)
        return float(np.sqrt(np.mean(np.sum(apart**2, axis=1)))) / self.size


def motion(d, angle, shift, about, rng):
    """A turn by ``angle`` about a point and a shift, in random directions, homogeneous."""
    axis, way = rng.normal(size=(2, d))
    R = geometry.rotation(angle * np.sign(axis[0])) if d == 2 else geometry.so3_exp(angle * axis / np.linalg.norm(axis))
    T = np.eye(d + 1)
    T[:d, :d], T[:d, d] = R, about - R @ about + shift * way / np.linalg.norm(way)
    return T


def back(T):
    """The inverse of a homogeneous rigid motion."""
    R, t = T[:-1, :-1], T[:-1, -1]
    inverse = np.eye(len(T))
    inverse[:-1, :-1], inverse[:-1, -1] = R.T, -R.T @ t
    return inverse


def problem(shape, n, rng, *, angle=0.2, shift=0.1, overlap=1.0, outliers=0.0, density=1.0, noise=0.005):
    """Two independent samplings of one shape, moved apart: angle in radians, all else as shares.

    shift, noise : of the shape's RMS radius.   overlap : what one cloud shares with the other.
    outliers : added to the source.   density : points in the target for each in the source.
    """
    target, source = shape(int(n * density), rng), shape(n, rng)
    d, centre = target.shape[1], target.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((target - centre) ** 2, axis=1))))
    if overlap < 1:
        way = rng.normal(size=d)
        place = (source - centre) @ way
        source = source[place < np.quantile(place, (1 + overlap) / 2)]
        place = (target - centre) @ way
        target = target[place > np.quantile(place, (1 - overlap) / 2)]
    strays = centre + rng.uniform(-1.5, 1.5, (int(outliers * len(source)), d)) * size
    source = rng.permutation(np.vstack([source, strays]))
    source = source + rng.normal(0, noise * size, source.shape)
    target = target + rng.normal(0, noise * size, target.shape)
    T = motion(d, angle, shift * size, centre, rng)
    return Problem(icp.move(back(T), source), target, T, size)
