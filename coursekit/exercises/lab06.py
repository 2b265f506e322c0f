"""The checks of Lab 6: pairs within reach, the best rotation, an RMSE, a step onto walls, and what a wall says."""

from __future__ import annotations

from typing import Any

import numpy as np

from coursekit.exercises import call, close, exercise, expect
from coursekit.geometry import rotation, so3_exp


@exercise("lab06.pair_up")
def pair_up(answer: Any, rng: np.random.Generator) -> None:
    grid = 2.0 * np.stack(np.meshgrid(range(4), range(4)), axis=-1).reshape(-1, 2)
    target, reach = rng.permutation(grid + rng.uniform(-0.2, 0.2, grid.shape)), 0.5
    chosen = rng.permutation(16)[:9]
    away = rng.normal(size=(9, 2))
    far = np.r_[rng.uniform(0.05, 0.45, 5), 0.6, 25.0, 30.0, 40.0]
    away *= far[:, None] / np.linalg.norm(away, axis=1)[:, None]
    order = rng.permutation(9)
    source = (target[chosen] + away)[order]
    distance = np.linalg.norm(source[:, None] - target, axis=2)
    nearest, near = distance.argmin(axis=1), distance.min(axis=1)
    expected = np.where(near <= reach, nearest, -1)
    got = call(answer, source, target, reach)
    close(
        got,
        expected,
        misconceptions={
            "Those beyond the reach have no partner: give them -1, or they pull as hard as all others.": nearest,
            "You compare a squared distance with a distance: with numbers below one, that reaches further.": np.where(
                near**2 <= reach, nearest, -1
            ),
            "That is the farthest point, not the nearest.": np.where(near <= reach, distance.argmax(axis=1), -1),
            "Those are the sources of each target; turned round, another number of pairs comes out.": np.where(
                distance.min(axis=0) <= reach, distance.argmin(axis=0), -1
            ),
            "Those are the distances; the indices were asked for.": near,
            "It keeps the far ones and drops the near ones: which side of the reach counts?": np.where(
                near > reach, nearest, -1
            ),
            "scipy marks a point without a partner by the number of targets, and no target has that index: say -1.": (
                np.where(near <= reach, nearest, len(target))
            ),
            "Dropping the far ones shifts the rest: entry k must belong to source point k.": nearest[near <= reach],
        },
        otherwise="Measure from each source point to every target point, then look for the smallest along one axis.",
        tolerance=1e-9,
    )


@exercise("lab06.best_rotation")
def best_rotation(answer: Any, rng: np.random.Generator) -> None:
    p = rng.normal(size=(15, 3)) * [1.0, 0.7, 0.02]
    R_true = so3_exp(rng.normal(size=3))
    q = p @ R_true.T
    q += rng.normal(0, 0.01, q.shape)
    q -= 2 * (q @ R_true[:, 2:]) * R_true[:, 2]  # turned inside out: the best orthogonal matrix is a mirror
    p, q = p + rng.uniform(1, 2, 3), q + rng.uniform(2, 3, 3)
    w = rng.uniform(0.1, 3.0, 15)

    def cross_covariance(weights: np.ndarray, for_means: np.ndarray) -> np.ndarray:
        p_mean, q_mean = for_means @ p / for_means.sum(), for_means @ q / for_means.sum()
        return (weights[:, None] * (q - q_mean)).T @ (p - p_mean)

    def best(H: np.ndarray) -> np.ndarray:
        U, _, Vt = np.linalg.svd(H)
        return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)

    same, H = np.ones(15), cross_covariance(w, w)
    U, _, Vt = np.linalg.svd(H)
    flip = np.diag([1.0, 1.0, np.linalg.det(U @ Vt)])
    expected = U @ flip @ Vt
    got = call(answer, p, q, w)
    close(
        got,
        expected,
        misconceptions={
            "Its determinant is -1: that is a mirror, and no robot drives through one.": U @ Vt,
            "That takes q to p: the other way round.": expected.T,
            "Changing the sign of the whole matrix moves all three axes; only the weakest may pay.": -(U @ Vt),
            "You flip the strongest axis; flip the one that costs least, the last.": U @ np.diag([-1.0, 1, 1]) @ Vt,
            "You turned over a column of R itself; the axis that costs least is the last of U, before V comes in.": (
                U @ Vt @ flip
            ),
            "numpy's svd returns Vᵀ, not V: do not transpose it again.": U @ flip @ Vt.T,
            "That is the cross-covariance itself; its singular vectors make the rotation.": H,
            "The clouds still stand where they came: take each one's centre away first.": best((w[:, None] * q).T @ p),
            "Every pair counts the same there: the weights have been left out.": best(cross_covariance(same, same)),
            "The centres are weighted means, too: with plain ones the shift leaks into the rotation.": best(
                cross_covariance(w, same)
            ),
            "The weights count twice there: once in H is enough.": best(cross_covariance(w**2, w)),
        },
        otherwise="Build H = Σ w q pᵀ from the weighted centres; take its SVD; look at the determinant.",
    )
    clean = so3_exp(rng.normal(size=3))
    solid = rng.normal(size=(15, 3))
    expect(
        np.allclose(call(answer, solid, solid @ clean.T + rng.normal(size=3), w), clean, atol=1e-8),
        "Mirrored pairs come out right, but honest ones no longer do: flip only when the determinant is negative.",
    )


@exercise("lab06.rmse")
def rmse(answer: Any, rng: np.random.Generator) -> None:
    pose = rng.uniform([-1, -1, 0.3], [1, 1, 1.2])
    source, target = rng.uniform(-2, 2, (12, 2)), rng.uniform(-2, 2, (20, 2))
    R, t = rotation(pose[2]), pose[:2]
    matches = np.stack([np.arange(0, 12, 2), rng.permutation(20)[:6]], axis=1)
    i, j = matches.T
    squares = np.sum((source[i] @ R.T + t - target[j]) ** 2, axis=1)
    inverse_way = np.sum((source[i] @ R + t - target[j]) ** 2, axis=1)
    got = call(answer, R, t, source, target, matches)
    close(
        got,
        np.sqrt(squares.mean()),
        misconceptions={
            "That is the mean distance; the R and the S of RMSE stand for a root and for squares.": np.sqrt(
                squares
            ).mean(),
            "That is the mean square: take its root, and the unit is metres again.": squares.mean(),
            "That averages over coordinates: a distance in the plane has two of them, and they add up.": np.sqrt(
                squares.mean() / 2
            ),
            "The root of the sum grows with the number of pairs: an M is missing.": np.sqrt(squares.sum()),
            "Rows of points times R rotate backwards: a row needs the transposed matrix.": np.sqrt(inverse_way.mean()),
            "You shift first and rotate then: the shift is turned along.": np.sqrt(
                np.mean(np.sum(((source[i] + t) @ R.T - target[j]) ** 2, axis=1))
            ),
            "Those points have not been moved yet.": np.sqrt(np.mean(np.sum((source[i] - target[j]) ** 2, axis=1))),
            "Pairs are (source, target) in this order, and not row k with row k.": np.sqrt(
                np.mean(np.sum((source[: len(i)] @ R.T + t - target[: len(i)]) ** 2, axis=1))
            ),
        },
        otherwise="Move the matched source points, subtract their partners, square, add, average, take the root.",
    )


@exercise("lab06.plane_step_3d")
def plane_step_3d(answer: Any, rng: np.random.Generator) -> None:
    n = 40
    p = rng.uniform(-3, 3, (n, 3)) + rng.uniform(0.5, 1.5, 3)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    shift, turn = rng.uniform(0.1, 0.3, 3), rng.uniform(0.02, 0.08, 3)
    q = p @ so3_exp(turn).T + shift + rng.normal(0, 0.01, p.shape)
    aside = rng.normal(0, 0.5, (n, 3))
    q = q + aside - normals * np.sum(normals * aside, axis=1)[:, None]  # along the walls: anywhere
    residual = np.sum(normals * (q - p), axis=1)

    def solve(arms: np.ndarray, lengths: np.ndarray = residual) -> np.ndarray:
        return np.asarray(np.linalg.lstsq(np.hstack([normals, np.cross(arms, normals)]), lengths, rcond=None)[0])

    expected = solve(p)
    full = np.zeros((n, 3, 6))
    full[:, :, :3] = np.eye(3)
    full[:, :, 3:] = np.cross(np.eye(3), p[:, None]).transpose(0, 2, 1)  # column k: e_k × p
    points = np.linalg.lstsq(full.reshape(-1, 6), (q - p).ravel(), rcond=None)[0]
    close(
        call(answer, p, q, normals),
        expected,
        misconceptions={
            "The robot walks away from the wall: the residual is where you want to go minus where you are.": -expected,
            "The turn goes the wrong way round: (φ × p)·n is φ·(p × n), and a cross product has an order.": solve(-p),
            "That is point-to-point: the offset along the wall has entered, and it means nothing.": points,
            "The distance to the partner is not the distance to its wall: only what lies along the normal counts.": (
                solve(p, np.linalg.norm(q - p, axis=1))
            ),
            "You have moved the points to their centre first; here φ turns them about the origin.": solve(
                p - p.mean(axis=0)
            ),
            "You have left out the turn: the shift alone cannot explain the residuals.": np.append(
                np.linalg.lstsq(normals, residual, rcond=None)[0], np.zeros(3)
            ),
            "That is the gradient, JᵀR; it still has to be divided by JᵀJ.": np.hstack(
                [normals, np.cross(p, normals)]
            ).T
            @ residual,
            "The arm of the turn is the point that moves, p; not its partner.": solve(q),
            "The shift comes first, then the turn: (x, y, z, φ_x, φ_y, φ_z).": np.roll(expected, 3),
            "That is the turn about z alone, as in the plane; in space a wall may ask for any axis.": _about_z(
                p, normals, residual
            ),
        },
        otherwise="One row per pair. Write n·(φ × p) as something times φ: a triple product may be turned round.",
    )


def _about_z(p: np.ndarray, normals: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Shift, and the lab's planar turn."""
    J = np.column_stack([normals, p[:, 0] * normals[:, 1] - p[:, 1] * normals[:, 0]])
    x, y, z, turn = np.linalg.lstsq(J, residual, rcond=None)[0]
    return np.array([x, y, z, 0.0, 0.0, turn])


@exercise("lab06.wall_covariance")
def wall_covariance(answer: Any, rng: np.random.Generator) -> None:
    n, sigma = 40, float(rng.uniform(0.3, 0.9))
    turn = rng.choice([0.0, 0.5 * np.pi, 1.1], n)
    normals = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    arms = rng.uniform(-3, 3, (n, 2))
    J = np.column_stack([normals, arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0]])
    info = J.T @ J
    expected = np.linalg.solve(info, np.eye(3)) * sigma**2
    every = np.zeros((2 * n, 3))
    every[0::2, 0] = every[1::2, 1] = 1
    every[0::2, 2], every[1::2, 2] = -arms[:, 1], arms[:, 0]
    tangents = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
    slide = np.column_stack([tangents, arms[:, 0] * tangents[:, 1] - arms[:, 1] * tangents[:, 0]])
    got = call(answer, normals, arms, sigma)
    close(
        got,
        expected,
        misconceptions={
            "That is the information; large where much is known. Its inverse was asked for.": info / sigma**2,
            "σ is a standard deviation; a covariance wants its square.": expected / sigma,
            "The noise itself is missing: with twice the σ nothing would change.": expected / sigma**2,
            "Every coordinate of every pair counts there: that is the frozen-pairs mistake, and a corridor would "
            "hold you.": np.linalg.solve(every.T @ every, np.eye(3)) * sigma**2,
            "You let the wall speak along itself; it speaks along its normal.": np.linalg.solve(
                slide.T @ slide, np.eye(3)
            )
            * sigma**2,
            "Averaged over the pairs, more points would not help; information adds up.": expected * n,
            "The variances are there, but x, y and φ err together: keep what is off the diagonal.": np.diag(
                np.diag(expected)
            ),
            "Inverting the diagonal alone forgets that x, y and φ err together.": np.diag(1 / np.diag(info)) * sigma**2,
        },
        otherwise="One row J = (n_x, n_y, r_x n_y - r_y n_x) per point; information JᵀJ/σ²; its inverse.",
        tolerance=1e-8,
    )
