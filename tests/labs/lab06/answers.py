"""Lab 6: who must pass, who must fail, and with which hint."""

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from tests.labs.answers import Answers


def stub(*arguments):
    raise NotImplementedError


def table(source, target):
    return np.linalg.norm(source[:, None] - target[None], axis=2)


def pair_up(source, target, reach):
    d = table(source, target)
    return np.where(d.min(axis=1) <= reach, d.argmin(axis=1), -1)


def pair_up_by_tree(source, target, reach):
    distance, index = cKDTree(target).query(source)
    return [int(i) if d <= reach else -1 for d, i in zip(distance, index, strict=True)]


def pair_up_from_the_target(source, target, reach):
    return pair_up(target, source, reach)


def pair_up_dropping(source, target, reach):
    found = pair_up(source, target, reach)
    return found[found >= 0]


def pair_up_squared(source, target, reach):
    d = table(source, target) ** 2
    return np.where(d.min(axis=1) <= reach, d.argmin(axis=1), -1)


def mutual(source, target, reach):
    found, back = pair_up(source, target, reach), table(source, target).argmin(axis=0)
    return np.where((found >= 0) & (back[found] == np.arange(len(source))), found, -1)


def first_come(source, target, reach):
    out = []
    for j in pair_up(source, target, reach):
        out.append(-1 if j in out else j)
    return out


def centred(points, w):
    return points - w @ points / np.sum(w)


def rotated(H):
    U, _, Vt = np.linalg.svd(H)
    return U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt


def decomposed(p, q, w):
    U, _, Vt = np.linalg.svd(centred(q, w).T @ np.diag(w) @ centred(p, w))
    return U, Vt, np.sign(np.linalg.det(U @ Vt))


def best_rotation(p, q, w):
    U, Vt, sign = decomposed(p, q, w)
    return U @ np.diag([1, 1, sign]) @ Vt


def best_rotation_by_scipy(p, q, w):
    return Rotation.align_vectors(centred(q, w), centred(p, w), weights=w)[0].as_matrix()


def always_flipped(p, q, w):
    U, Vt, _ = decomposed(p, q, w)
    return U @ np.diag([1, 1, -1]) @ Vt


def moved(R, t, source, target, matches):
    return source[matches[:, 0]] @ R.T + t - target[matches[:, 1]]


def rmse(R, t, source, target, matches):
    return np.sqrt(np.mean(np.sum(moved(R, t, source, target, matches) ** 2, axis=1)))


def rmse_by_loop(R, t, source, target, matches):
    return (sum(np.linalg.norm(R @ source[i] + t - target[j]) ** 2 for i, j in matches) / len(matches)) ** 0.5


def rows(points, normals):
    return np.column_stack([normals, points[:, 0] * normals[:, 1] - points[:, 1] * normals[:, 0]])


def along(normals, q, p):
    return np.sum(normals * (q - p), axis=1)


def solve_3d(arms, normals, lengths):
    return np.linalg.lstsq(np.hstack([normals, np.cross(arms, normals)]), lengths, rcond=None)[0]


def plane_step_3d(p, q, normals):
    return solve_3d(p, normals, along(normals, q, p))


def plane_step_3d_by_normal_equations(p, q, normals):
    H, g = np.zeros((6, 6)), np.zeros(6)
    for a, b, n in zip(p, q, normals, strict=True):
        J = np.r_[n, [n @ np.cross(axis, a) for axis in np.eye(3)]]
        H, g = H + np.outer(J, J), g + J * (n @ (b - a))
    return np.linalg.solve(H, g)


def point_step_3d(p, q, normals):
    rows = [np.r_[axis, [axis @ np.cross(e, a) for e in np.eye(3)]] for a in p for axis in np.eye(3)]
    return np.linalg.lstsq(np.array(rows), (q - p).ravel(), rcond=None)[0]


def turned_about_z(p, q, normals):
    x, y, z, turn = np.linalg.lstsq(
        np.column_stack([normals, p[:, 0] * normals[:, 1] - p[:, 1] * normals[:, 0]]), along(normals, q, p), rcond=None
    )[0]
    return [x, y, z, 0, 0, turn]


def wall_covariance(normals, arms, sigma):
    J = rows(arms, normals)
    return sigma**2 * np.linalg.inv(J.T @ J)


def wall_covariance_by_qr(normals, arms, sigma):
    R = np.linalg.qr(rows(arms, normals) / sigma)[1]
    root = np.linalg.solve(R, np.eye(3))
    return root @ root.T


def every_coordinate(normals, arms, sigma):
    J = np.zeros((2 * len(arms), 3))
    J[0::2, 0] = J[1::2, 1] = 1
    J[0::2, 2], J[1::2, 2] = -arms[:, 1], arms[:, 0]
    return sigma**2 * np.linalg.inv(J.T @ J)


ANSWERS = {
    "lab06.pair_up": Answers(
        stub=stub,
        reference=pair_up,
        second=pair_up_by_tree,
        wrong={
            "no reach": (lambda s, t, reach: table(s, t).argmin(axis=1), "Those beyond the reach"),
            "squared against plain": (pair_up_squared, "squared distance with a distance"),
            "farthest": (
                lambda s, t, reach: np.where(table(s, t).min(axis=1) <= reach, table(s, t).argmax(axis=1), -1),
                "the farthest point",
            ),
            "from the target": (pair_up_from_the_target, "sources of each target"),
            "distances": (lambda s, t, reach: table(s, t).min(axis=1), "the indices were asked for"),
            "wrong side": (
                lambda s, t, reach: np.where(table(s, t).min(axis=1) > reach, table(s, t).argmin(axis=1), -1),
                "which side of the reach",
            ),
            "scipy's mark": (
                lambda s, t, reach: cKDTree(t).query(s, distance_upper_bound=reach)[1],
                "scipy marks",
            ),
            "dropped": (pair_up_dropping, "shifts the rest"),
            "mutual": (mutual, "only the nearer of them"),
            "first come": (first_come, "only the first of them"),
        },
        both={
            "no reach, farthest": (
                lambda s, t, reach: table(s, t).argmax(axis=1),
                ("Those beyond the reach", "the farthest point", "Measure from each"),
            ),
            "squared, scipy's mark": (
                lambda s, t, reach: np.where(table(s, t).min(axis=1) ** 2 <= reach, table(s, t).argmin(axis=1), len(t)),
                ("squared distance with a distance", "scipy marks"),
            ),
            "mutual, scipy's mark": (
                lambda s, t, reach: np.where(mutual(s, t, reach) < 0, len(t), mutual(s, t, reach)),
                ("scipy marks", "only the nearer"),
            ),
        },
    ),
    "lab06.best_rotation": Answers(
        stub=stub,
        reference=best_rotation,
        second=best_rotation_by_scipy,
        wrong={
            "mirror": (lambda *a: decomposed(*a)[0] @ decomposed(*a)[1], "that is a mirror"),
            "inverse": (lambda *a: best_rotation(*a).T, "the other way round"),
            "whole sign": (lambda *a: -(decomposed(*a)[0] @ decomposed(*a)[1]), "all three axes"),
            "strongest axis": (
                lambda *a: decomposed(*a)[0] @ np.diag([-1, 1, 1]) @ decomposed(*a)[1],
                "the strongest axis",
            ),
            "column of R": (
                lambda *a: decomposed(*a)[0] @ decomposed(*a)[1] @ np.diag([1, 1, decomposed(*a)[2]]),
                "a column of R itself",
            ),
            "V for its transpose": (
                lambda *a: decomposed(*a)[0] @ np.diag([1, 1, -1]) @ decomposed(*a)[1].T,
                "numpy's svd returns",
            ),
            "cross-covariance": (
                lambda p, q, w: centred(q, w).T @ np.diag(w) @ centred(p, w),
                "cross-covariance itself",
            ),
            "where they came": (lambda p, q, w: rotated(q.T @ np.diag(w) @ p), "still stand where they came"),
            "no weights": (lambda p, q, w: best_rotation(p, q, np.ones(len(w))), "have been left out"),
            "plain means": (
                lambda p, q, w: rotated((q - q.mean(axis=0)).T @ np.diag(w) @ (p - p.mean(axis=0))),
                "weighted means, too",
            ),
            "weights twice": (
                lambda p, q, w: rotated(centred(q, w).T @ np.diag(w**2) @ centred(p, w)),
                "count twice",
            ),
            "always flipped": (always_flipped, "honest ones no longer do"),
            "w not in H": (lambda p, q, w: rotated(centred(q, w).T @ centred(p, w)), "belong into the sum B"),
            "every weight at least a little": (
                lambda p, q, w: best_rotation(p, q, np.maximum(w, 0.1)),
                "A pair of weight zero",
            ),
        },
        both={
            "mirror, no weights": (
                lambda p, q, w: np.matmul(*decomposed(p, q, np.ones(len(w)))[:2]),
                ("that is a mirror", "have been left out"),
            ),
            "inverse, no weights": (
                lambda p, q, w: best_rotation(p, q, np.ones(len(w))).T,
                ("the other way round", "have been left out"),
            ),
            "mirror, where they came": (
                lambda p, q, w: np.matmul(*np.linalg.svd(q.T @ np.diag(w) @ p)[::2]),
                ("that is a mirror", "still stand where they came"),
            ),
        },
    ),
    "lab06.rmse": Answers(
        stub=stub,
        reference=rmse,
        second=rmse_by_loop,
        wrong={
            "mean distance": (lambda *a: np.linalg.norm(moved(*a), axis=1).mean(), "That is the mean distance"),
            "no root": (lambda *a: rmse(*a) ** 2, "take its root"),
            "per coordinate": (lambda *a: np.sqrt(np.mean(moved(*a) ** 2)), "averages over coordinates"),
            "sum": (lambda *a: np.sqrt(np.sum(moved(*a) ** 2)), "an M is missing"),
            "backwards": (lambda R, t, s, q, m: rmse(R.T, t, s, q, m), "rotate backwards"),
            "shift first": (lambda R, t, s, q, m: rmse(R, R @ t, s, q, m), "the shift is turned along"),
            "not moved": (lambda R, t, s, q, m: rmse(np.eye(2), 0 * t, s, q, m), "not been moved"),
            "row by row": (
                lambda R, t, s, q, m: rmse(R, t, s, q, np.stack([np.arange(len(m))] * 2, axis=1)),
                "not row k with row k",
            ),
        },
        both={
            "no root, per coordinate": (
                lambda *a: np.mean(moved(*a) ** 2),
                ("take its root", "averages over coordinates"),
            ),
            "sum, no root": (lambda *a: np.sum(moved(*a) ** 2), ("an M is missing", "take its root")),
            "backwards, no root": (
                lambda R, t, s, q, m: rmse(R.T, t, s, q, m) ** 2,
                ("rotate backwards", "take its root"),
            ),
            "not moved, per coordinate": (
                lambda R, t, s, q, m: np.sqrt(np.mean((s[m[:, 0]] - q[m[:, 1]]) ** 2)),
                ("not been moved", "averages over coordinates"),
            ),
        },
    ),
    "lab06.plane_step_3d": Answers(
        stub=stub,
        reference=plane_step_3d,
        second=plane_step_3d_by_normal_equations,
        wrong={
            "sign": (lambda p, q, n: -plane_step_3d(p, q, n), "walks away from the wall"),
            "turn's order": (lambda p, q, n: solve_3d(-p, n, along(n, q, p)), "wrong way round"),
            "point to point": (point_step_3d, "That is point-to-point"),
            "length for the normal's part": (
                lambda p, q, n: solve_3d(p, n, np.linalg.norm(q - p, axis=1)),
                "not the distance to its wall",
            ),
            "centred": (lambda p, q, n: solve_3d(p - p.mean(axis=0), n, along(n, q, p)), "to their centre first"),
            "no turn": (
                lambda p, q, n: np.append(np.linalg.lstsq(n, along(n, q, p), rcond=None)[0], [0, 0, 0]),
                "left out the turn",
            ),
            "gradient": (
                lambda p, q, n: np.hstack([n, np.cross(p, n)]).T @ along(n, q, p),
                "That is the gradient",
            ),
            "arm of the partner": (lambda p, q, n: solve_3d(q, n, along(n, q, p)), "not its partner"),
            "turn first": (lambda p, q, n: np.roll(plane_step_3d(p, q, n), 3), "The shift comes first"),
            "as in the plane": (turned_about_z, "the turn about z alone"),
        },
        both={
            "sign, turn first": (
                lambda p, q, n: -np.roll(plane_step_3d(p, q, n), 3),
                ("walks away from the wall", "The shift comes first"),
            ),
            "point to point, sign": (
                lambda p, q, n: -point_step_3d(p, q, n),
                ("walks away from the wall", "That is point-to-point"),
            ),
            "sign, arm of the partner": (
                lambda p, q, n: -solve_3d(q, n, along(n, q, p)),
                ("walks away from the wall", "not its partner"),
            ),
        },
    ),
    "lab06.wall_covariance": Answers(
        stub=stub,
        reference=wall_covariance,
        second=wall_covariance_by_qr,
        wrong={
            "information": (lambda n, r, s: rows(r, n).T @ rows(r, n) / s**2, "large where much is known"),
            "sigma": (lambda n, r, s: wall_covariance(n, r, s) / s, "wants its square"),
            "no noise": (lambda n, r, s: wall_covariance(n, r, 1.0), "The noise itself is missing"),
            "every coordinate": (every_coordinate, "frozen-pairs"),
            "tangents": (
                lambda n, r, s: wall_covariance(np.stack([-n[:, 1], n[:, 0]], axis=1), r, s),
                "speak along itself",
            ),
            "averaged": (lambda n, r, s: wall_covariance(n, r, s) * len(n), "information adds up"),
            "diagonal": (lambda n, r, s: np.diag(np.diag(wall_covariance(n, r, s))), "off the diagonal"),
            "inverse of the diagonal": (
                lambda n, r, s: s**2 * np.diag(1 / np.sum(rows(r, n) ** 2, axis=0)),
                "Inverting the diagonal",
            ),
        },
        both={
            "tangents, sigma": (
                lambda n, r, s: wall_covariance(np.stack([-n[:, 1], n[:, 0]], axis=1), r, s) / s,
                ("wants its square", "speak along itself"),
            ),
            "every coordinate, no noise": (
                lambda n, r, s: every_coordinate(n, r, 1.0),
                ("The noise itself is missing", "frozen-pairs"),
            ),
            "diagonal, sigma": (
                lambda n, r, s: np.diag(np.diag(wall_covariance(n, r, s))) / s,
                ("wants its square", "off the diagonal"),
            ),
        },
    ),
}
