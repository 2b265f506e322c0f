"""Lab 5's checks: growing a state and its covariance, what a measurement touches, association, judging a map."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import chi2

from coursekit.geometry import Array
from coursekit.models import RangeBearing
from coursekit.teaching.exercises import call, close, exercise, expect


def _covariance(rng: np.random.Generator, n: int) -> Array:
    A = rng.normal(size=(n, n))
    return A @ A.T + 0.3 * np.eye(n)


@exercise("lab05.augment_mean")
def augment_mean(answer: Any, rng: np.random.Generator) -> None:
    for landmarks, bearing in ((2, rng.uniform(0.2, 0.5)), (3, -rng.uniform(0.2, 0.5)), (0, rng.uniform(-3, 3))):
        heading = rng.uniform(0.3, 2.8) * rng.choice([-1, 1])
        mean = np.r_[rng.uniform(-3, 3, 2), heading, rng.normal(size=2 * landmarks)]
        _augment_mean(answer, mean, np.array([rng.uniform(1, 3), bearing]))


def _augment_mean(answer: Any, mean: Array, z: Array) -> None:
    pose, new = mean[:3], RangeBearing.g(mean[:3], z)

    def polar(angle: float) -> Array:
        return z[0] * np.array([np.cos(angle), np.sin(angle)])

    direction = pose[2] + z[1]
    close(
        call(answer, mean, z),
        np.r_[mean, new],
        misconceptions={
            "Your landmark forgets which way the robot looks: the bearing is counted from its heading.":
                np.r_[mean, pose[:2] + polar(z[1])],
            "That is where the landmark is as seen from the robot; the map is in the world.":
                np.r_[mean, polar(direction)],
            "Positive bearings are to the left, the way headings grow: the two have the same sign.":
                np.r_[mean, pose[:2] + polar(pose[2] - z[1])],
            "Sine and cosine have changed places: at direction zero, the landmark is ahead along x.":
                np.r_[mean, pose[:2] + polar(direction)[::-1]],
            "A range and a bearing are no place: turn them into x and y before they go into the map.": np.r_[mean, z],
            "The new landmark goes to the end; in the middle it would push every other one out of its rows.":
                np.r_[pose, new, mean[3:]],
            "That is the new landmark alone: the state still holds the robot and the old ones.": new,
        },
        otherwise="Two more numbers at the end: the robot's place, and z[0] metres from there in direction θ + z[1].",
    )  # fmt: skip


@exercise("lab05.augment_cov")
def augment_cov(answer: Any, rng: np.random.Generator) -> None:
    _augment_cov(answer, rng, 7)
    _augment_cov(answer, rng, 5)
    P, R, pose, z = _covariance(rng, 3), _covariance(rng, 2), rng.normal(size=3), np.array([1.0, 0.3])
    Gx, Gz = RangeBearing.Gx(pose, z), RangeBearing.Gz(pose, z)
    J = np.block([[np.eye(3), np.zeros((3, 2))], [Gx, Gz]])
    close(call(answer, P, Gx, Gz, R), J @ block_diag(P, R) @ J.T,
          otherwise="The first landmark of all comes out wrong: then P is (3, 3), the pose alone.")  # fmt: skip


def _augment_cov(answer: Any, rng: np.random.Generator, n: int) -> None:
    P, R = _covariance(rng, n), np.diag(rng.uniform(0.1, 0.5, 2)) ** 2
    pose, z = rng.normal(size=3), np.array([rng.uniform(1, 3), rng.uniform(-0.5, 0.5)])
    Gx, Gz = RangeBearing.Gx(pose, z), RangeBearing.Gz(pose, z)
    cross, own, noise = Gx @ P[:3], Gx @ P[:3, :3] @ Gx.T, Gz @ R @ Gz.T

    def grown(cross: Array, corner: Array) -> Array:
        return np.block([[P, cross.T], [cross, corner]])

    with_pose = np.c_[cross[:, :3], np.zeros((2, n - 3))]
    one_sided = grown(cross, own + noise)
    one_sided[:n, n:] = 0.0
    close(
        call(answer, P, Gx, Gz, R),
        grown(cross, own + noise),
        misconceptions={
            "No cross-covariance: your map does not know that the robot's error and the landmark's are the same one.":
                block_diag(P, own + noise),
            "A thousand and zeros is the report's start: it throws away where the landmark was seen from.":
                block_diag(P, 1000 * np.eye(2)),
            "The robot is not sure where it stands, and whatever it sees inherits that: one term is missing.":
                grown(cross, noise),
            "Your landmark takes the measurement for perfect: where is R?": grown(cross, own),
            "R is in metres and radians; Gz turns it into metres and metres.": grown(cross, own + R),
            "The new landmark goes with the robot, and the old landmarks go with the robot too: fill the whole row.":
                grown(with_pose, own + noise),
            "Two independent errors add their variances, whatever their signs were.": grown(cross, own - noise),
            "A covariance is symmetric: the block on the right is missing.": one_sided,
        },
        otherwise="Write the landmark's error as Gx e_pose + Gz e_z, and take its product with the whole error vector.",
    )  # fmt: skip


@exercise("lab05.nonzero")
def nonzero(answer: Any, rng: np.random.Generator) -> None:
    n = int(rng.integers(7, 11))
    j = int(rng.integers(4, n - 1))
    _nonzero(answer, j, n)
    for edge in ((0, 1), (0, n), (n - 1, n)):
        H = np.zeros((2, 3 + 2 * edge[1]))
        H[:, :2], H[1, 2], H[:, 3 + 2 * edge[0] : 5 + 2 * edge[0]] = 1, 1, 1
        close(call(answer, *edge), H, otherwise="Right for most landmarks; the first or the last one comes out wrong.")


def _nonzero(answer: Any, j: int, n: int) -> None:

    def mask(*where: tuple[int, int]) -> Array:
        out = np.zeros((2, 3 + 2 * n))
        for row, column in where:
            out[row, column] = 1.0
        return out

    robot = [(0, 0), (0, 1), (1, 0), (1, 1)]

    def pair(a: int) -> list[tuple[int, int]]:
        return [(0, a), (0, a + 1), (1, a), (1, a + 1)]

    a = 3 + 2 * j
    got = call(answer, j, n)
    close(
        got,
        mask(*robot, (1, 2), *pair(a)),
        misconceptions={
            "A landmark is two numbers, x and y: with one column, half of each is never seen (the report's map).":
                mask(*robot, (1, 2), (0, a), (1, a)),
            "Turn on the spot, and one of the two measurements changes: the heading has an entry.":
                mask(*robot, *pair(a)),
            "Turn on the spot, and the range stays as it is: one of the heading's entries is zero.":
                mask(*robot, (0, 2), (1, 2), *pair(a)),
            "You left no room for the pose: the landmarks start behind its three numbers.":
                mask(*robot, (1, 2), *pair(2 * j)),
            "Each landmark before it takes two places, not one.": mask(*robot, (1, 2), *pair(3 + j)),
            "Landmarks are counted from zero here: that is the one after it.": mask(*robot, (1, 2), *pair(a + 2)),
            "Landmark 0 stands right behind the pose: yours is the one before the one that was asked for.":
                mask(*robot, (1, 2), *pair(a - 2)),
            "All of P changes with this measurement, but that is K's doing: h asks for one landmark only.":
                np.ones((2, 3 + 2 * n)),
            "Seen from the robot: move *it*, and the measurement changes too.": mask(*pair(a)),
        },
        otherwise="Nine entries. Move one number of the state a little, and ask which of range and bearing notice.",
    )  # fmt: skip


@exercise("lab05.associate")
def associate(answer: Any, rng: np.random.Generator) -> None:
    def scene(*distances: float) -> tuple[Array, Array]:
        """Four landmarks that many standard deviations away, the first and the last of them sharp."""
        sigmas = np.array([[0.03, 0.015], [0.9, 0.3], [0.9, 0.3], [0.03, 0.015]]) * rng.uniform(0.9, 1.1, (4, 1))
        turn = rng.uniform(0, 2 * np.pi, 4)
        nu = np.array(distances)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1) * sigmas
        order = np.array([2, *rng.permutation([0, 1, 3])])  # what comes first is in the gate, and not the nearest
        return nu[order], np.stack([np.diag(s**2) for s in sigmas[order]])

    def ask(distances: tuple[float, ...], hints: Callable[[Array, Array], dict[str, int]], gate: float = 0.99) -> None:
        judge(*scene(*distances), gate, hints)

    def judge(nu: Array, S: Array, gate: float, hints: Callable[[Array, Array], dict[str, int]]) -> None:
        d2 = np.einsum("ni,ni->n", nu, np.linalg.solve(S, nu[..., None])[..., 0])
        none = (
            "Your function returns None. When no landmark lies within the gate, say -1, and see that each way through "
        )
        none += "the function ends with a return."
        got = np.asarray(call(answer, nu, S, gate, none=none))
        expect(got.shape == () and np.issubdtype(got.dtype, np.number), "Return one number, an index or -1.")
        right = int(np.argmin(d2)) if d2.min() < chi2.ppf(gate, 2) else -1
        close(got, right, misconceptions=hints(nu, d2),
              otherwise="d² = νᵀ S⁻¹ ν for each landmark; take the least, if it is within the gate.")  # fmt: skip

    ask(
        (2.6, 0.5, 1.9, 6.0),
        lambda nu, d2: {
            "Inverted: what is near is known. The report's rule is written this way round.": -1,
            "That one is nearest in metres; ask how many standard deviations away it is, with the *inverse* of S.":
                int(np.argmin(np.linalg.norm(nu, axis=1))),
            "That is the first one in the gate; several may be, and one fits best.": 0,
            "That is the landmark that fits *worst*.": int(np.argmax(d2)),
        },
    )  # fmt: skip
    ask((2.6, 1.2, 1.9, 6.0), lambda nu, d2: {
        "The gate is a probability; the distance that belongs to it comes from the χ² distribution.": -1,
    })  # fmt: skip
    ask((12.0, 13.0, 14.0, 15.0), lambda nu, d2: {
        "Nothing is near enough, and you still picked one: where is the gate?": int(np.argmin(d2)),
    })  # fmt: skip
    ask((4.0, 3.6, 3.8, 5.0), lambda nu, d2: {
        "χ² is the distribution of the *squared* distance; yours is still under a root.": int(np.argmin(d2)),
    })  # fmt: skip
    ask((4.0, 2.8, 2.9, 5.0), lambda nu, d2: {
        "Range and bearing are two numbers: your threshold is that of one degree of freedom.": -1,
    })  # fmt: skip
    ask((3.0, 2.6, 2.7, 5.0), lambda nu, d2: {
        "The gate is an argument: yours is that of 99 %, whatever was asked for.": int(np.argmin(d2)),
    }, gate=0.9)  # fmt: skip
    turned = 0.05 * np.array([[1.0, 0.95], [0.95, 1.0]])  # long along one diagonal, thin along the other
    nu, S = np.array([[-0.11, 0.11], [0.3, 0.3]]) * rng.uniform(0.95, 1.0, (2, 1)), np.stack([turned, turned])
    judge(nu, S, 0.99, lambda nu, d2: {
        "You divided each number by its own σ. The two errors go together: use the whole of S.": 0,
    })  # fmt: skip


@exercise("lab05.judge_map")
def judge_map(answer: Any, rng: np.random.Generator) -> None:
    within, m, doubles = 0.2, int(rng.integers(6, 9)), 1
    found = int(rng.integers(3, m - 2))
    far = m - found + 1  # so that none of the counts below is another
    layout = np.array([[0.41, 0.0], [0.0, 0.0], *(3.0 * np.array([[k, k % 3] for k in range(1, m - 1)]))])
    tags = layout + rng.normal(size=2)
    seen = [0, *range(2, found + 1), 0]  # the first one twice
    turn = rng.uniform(0, 2 * np.pi, found + doubles)
    near = tags[seen] + rng.uniform(0.03, 0.1, (found + doubles, 1)) * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    ghosts = tags.mean(axis=0) + rng.uniform(40, 60, (far, 2)) * rng.choice([-1, 1], (far, 2))
    order = rng.permutation(m)
    tags, landmarks = tags[order], rng.permutation(np.concatenate([near, ghosts]))
    got = call(answer, landmarks, tags, within)
    expect(isinstance(got, (tuple, list)) and len(got) == 3,
           "Return three things: tags found, landmarks too many, mean error.")  # fmt: skip
    d = np.linalg.norm(landmarks[:, None] - tags, axis=-1)
    error = d.min(axis=0)[d.min(axis=0) < within]
    each = landmarks[d.argmin(axis=0)[d.min(axis=0) < within]] - tags[d.min(axis=0) < within]
    close(
        got[0],
        found,
        misconceptions={
            "You counted landmarks: a tag that stands in the map twice was found once.": found + doubles,
            "Those are all the tags there are: one without a landmark near it was not found.": m,
            "That is the size of the map, right or wrong.": len(landmarks),
        },
        together=False,
        otherwise="For each tag: is there a landmark within reach?",
    )
    close(
        got[1],
        doubles + far,
        misconceptions={
            "A second landmark for the same tag is one too many as well, not only one far from everything.": far,
            "Tags that are missing and landmarks that are too many do not cancel.": len(landmarks) - m,
            "Those are the tags that were not found; asked for are the landmarks that stand for no tag.": m - found,
        },
        together=False,
        otherwise="Every landmark that is not *the* landmark of a tag is one too many.",
    )
    close(
        got[2],
        error.mean(),
        misconceptions={
            "You averaged over the coordinates, as the report did; a landmark's error is a distance.":
                np.abs(each).mean(),
            "That is the root of the mean square, not the mean.": np.sqrt(np.mean(error**2)),
            "That is a root mean square over the coordinates; a landmark's error is a distance, and the mean is asked "
            "for.": np.sqrt(np.mean(each**2)),
            "A landmark out of reach stands for no tag, so it has no error either: leave it out.":
                d.min(axis=1).mean(),
            "Tags that were not found are counted as missing already; their distances do not belong in the error.":
                d.min(axis=0).mean(),
            "Twice-mapped tags count twice in your mean: take each tag's nearest landmark.":
                d.min(axis=1)[d.min(axis=1) < within].mean(),
        },
        otherwise="For each tag that was found: the distance to its nearest landmark. Then the mean.",
    )  # fmt: skip
