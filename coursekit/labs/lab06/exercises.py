"""The checks of Lab 6: pairs within reach, the best rotation, an RMSE, a step onto walls, and what a wall says."""

from __future__ import annotations

from typing import Any

import numpy as np

from coursekit.geometry import rotation, so3_exp
from coursekit.teaching.exercises import call, close, exercise, expect


@exercise("lab06.pair_up")
def pair_up(answer: Any, rng: np.random.Generator) -> None:
    reach = float(rng.uniform(0.3, 0.6))
    grid = 2.0 * np.stack(np.meshgrid(range(4), range(4)), axis=-1).reshape(-1, 2)
    target = rng.permutation(grid + rng.uniform(-0.2, 0.2, grid.shape))
    chosen = rng.permutation(16)[:9]
    between = 0.5 * (reach + np.sqrt(reach))  # beyond the reach, and its square is not
    far = np.r_[rng.uniform(0.5, 0.9, 5) * reach, between, 25.0, 30.0, 40.0]
    _pair_up(answer, rng, target[chosen], far, target, reach)
    shared = chosen[[0, 0, 0, 1, 1, 2, 3, 4, 5]]  # two or three sources that have one and the same partner
    far = np.r_[[0.7 * reach, 0.2 * reach, 0.5 * reach, 0.6 * reach, 0.3 * reach], rng.uniform(0.1, 0.9, 3) * reach, 30]
    _pair_up(answer, rng, target[shared], far, target, reach)
    _pair_up(answer, rng, target[[0, 1, 1, 2, 0, 1]], np.r_[0.1, 0.2, 0.3, 30, 0.25, 0.15] * reach, target[:3], reach)


def _pair_up(
    answer: Any, rng: np.random.Generator, partner: np.ndarray, far: np.ndarray, target: np.ndarray, reach: float
) -> None:
    """Each source stands that far from its partner, in any direction; the order is first the given one."""
    away = rng.normal(size=partner.shape)
    source = partner + away * (far / np.linalg.norm(away, axis=1))[:, None]
    source = source[np.r_[0, 1 + rng.permutation(len(far) - 1)]]
    distance = np.linalg.norm(source[:, None] - target, axis=2)
    nearest, near = distance.argmin(axis=1), distance.min(axis=1)
    expected = np.where(near <= reach, nearest, -1)
    k = np.arange(len(source))
    mutual = np.where((near <= reach) & (distance.argmin(axis=0)[nearest] == k), nearest, -1)
    taken = np.array([target_index in expected[:i] for i, target_index in enumerate(nearest)])
    first = np.where((near <= reach) & ~taken, nearest, -1)
    got = call(answer, source, target, reach)
    close(
        got,
        expected,
        misconceptions={
            "Those beyond the reach have no partner: give them -1, or they pull as hard as all others.": nearest,
            "You compare a squared distance with a distance: with numbers below one, that reaches further.": np.where(
                near**2 <= reach, nearest, -1
            ),
            "Two source points may have the same partner; you let only the nearer of them have it.": mutual,
            "Two source points may have the same partner; you let only the first of them have it.": first,
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
    _best_rotation(answer, p, q, w)
    solid, clean, sure = rng.normal(size=(15, 3)), so3_exp(rng.normal(size=3)), w.copy()
    moved = solid @ clean.T + rng.normal(size=3)
    expect(
        np.allclose(call(answer, solid, moved, w), clean, atol=1e-8),
        "Mirrored pairs come out right, but honest ones no longer do: flip only when the determinant is negative.",
    )
    moved[:3], sure[:3] = rng.normal(size=(3, 3)), 0.0
    expect(
        np.allclose(call(answer, solid, moved, sure), clean, atol=1e-8),
        "A pair of weight zero has no say, and it changed your rotation.",
    )


def _best_rotation(answer: Any, p: np.ndarray, q: np.ndarray, w: np.ndarray) -> None:
    def cross_covariance(weights: np.ndarray, for_means: np.ndarray) -> np.ndarray:
        p_mean, q_mean = for_means @ p / for_means.sum(), for_means @ q / for_means.sum()
        return (weights[:, None] * (q - q_mean)).T @ (p - p_mean)

    def best(H: np.ndarray) -> np.ndarray:
        U, _, Vt = np.linalg.svd(H)
        return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)

    same, H = np.ones(len(w)), cross_covariance(w, w)
    mirror = "Its determinant is -1: that is a mirror, and no robot drives through one."
    spoiled = {
        "The clouds still stand where they came: take each one's centre away first.": (w[:, None] * q).T @ p,
        "Every pair counts the same there: the weights have been left out.": cross_covariance(same, same),
        "The weights are in the centres, and they belong into the sum B as well.": cross_covariance(same, w),
        "The centres are weighted means, too: with plain ones the shift leaks into the rotation.":
            cross_covariance(w, same),
        "The weights count twice there: once in B is enough.": cross_covariance(w**2, w),
    }  # fmt: skip
    U, _, Vt = np.linalg.svd(H)
    flip = np.diag([1.0, 1.0, np.linalg.det(U @ Vt)])
    expected = U @ flip @ Vt
    got = call(answer, p, q, w)
    close(
        got,
        expected,
        misconceptions={
            mirror: U @ Vt,
            "That takes q to p: the other way round.": expected.T,
            "Changing the sign of the whole matrix moves all three axes; only the weakest may pay.": -(U @ Vt),
            "You flip the strongest axis; flip the one that costs least, the last.": U @ np.diag([-1.0, 1, 1]) @ Vt,
            "You turned over a column of R itself; the axis that costs least is the last of U, before V comes in.": (
                U @ Vt @ flip
            ),
            "numpy's svd returns Vᵀ, not V: do not transpose it again.": U @ flip @ Vt.T,
            "That is the cross-covariance itself; its singular vectors make the rotation.": H,
            **{hint: best(H) for hint, H in spoiled.items()},
            **{f"{mirror} {hint}": np.linalg.svd(H)[0] @ np.linalg.svd(H)[2] for hint, H in spoiled.items()},
        },
        otherwise="Build B = Σ w q pᵀ from the weighted centres; take its SVD; look at the determinant.",
    )


@exercise("lab06.rmse")
def rmse(answer: Any, rng: np.random.Generator) -> None:
    for quarter in range(4):
        x, y, turn = rng.uniform([0.4, 0.4, 0.3], [1, 1, 1.2])
        _rmse(answer, rng, np.array([x * rng.choice([-1, 1]), y, turn + quarter * np.pi / 2]))


def _rmse(answer: Any, rng: np.random.Generator, pose: np.ndarray) -> None:
    source, target = rng.uniform(-2, 2, (12, 2)), rng.uniform(-2, 2, (20, 2))
    R, t = rotation(pose[2]), pose[:2]
    matches = np.stack([2 * rng.permutation(6), rng.permutation(20)[[0, 1, 2, 3, 4, 4]]], axis=1)
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
    shift, turn = shift * rng.choice([-1, 1], 3), turn * rng.choice([-1, 1], 3)
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
    hint = "A point on a wall that you stand in front of says something of the turn as well: the third column of J."
    got = call(answer, normals, arms, sigma, stops={"ingular": hint})
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
