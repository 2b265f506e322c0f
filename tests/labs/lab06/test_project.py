"""Lab 6's project: a sound ICP gets its marks, and a broken one the finding that it deserves."""

import numpy as np
import pytest

from coursekit import geometry
from coursekit.labs.lab06.project import PROJECT, reference
from tests.labs.judge import Judge


def plain(source, target, *, rows="planes", robust=True, iterations=30, spread=2.0, stay=False):
    """As a student writes it: brute force, lines through eight neighbours, Cauchy's weights."""
    between = np.linalg.norm(target[:, None] - target, axis=2)
    group = target[np.argsort(between, axis=1)[:, :8]]
    middle = group.mean(axis=1)
    around = group - middle[:, None]
    normals = np.linalg.eigh(np.swapaxes(around, 1, 2) @ around)[1][:, :, 0]
    pose = np.zeros(3)
    for _ in range(iterations):
        moved = geometry.transform(pose, source)
        apart = np.linalg.norm(moved[:, None] - target, axis=2)
        j = apart.argmin(axis=1)
        arm, near = moved - pose[:2], apart.min(axis=1) < 0.5
        if rows == "planes":
            n = normals[j]
            r = np.sum(n * (middle[j] - moved), axis=1)
            J = np.column_stack([n, arm[:, 0] * n[:, 1] - arm[:, 1] * n[:, 0]])
        else:
            r, near, one, none = (target[j] - moved).T.ravel(), np.tile(near, 2), np.ones(len(j)), np.zeros(len(j))
            J = np.column_stack([np.r_[one, none], np.r_[none, one], np.r_[-arm[:, 1], arm[:, 0]]])
        scale = 1.4826 * np.median(np.abs(r[near]))
        w = near / (1 + (r / (2.385 * scale)) ** 2) if robust else near.astype(float)
        step = np.linalg.solve(J.T @ (w[:, None] * J), J.T @ (w * r))
        pose = np.zeros(3) if stay else pose + step
    used = near & (np.abs(r) < 3 * scale)
    info = J[used].T @ J[used]
    return pose, spread * np.mean(r[used] ** 2) * np.linalg.inv(info)


def points(source, target):
    return plain(source, target, rows="points", iterations=60)


def every_pair(source, target):
    return plain(source, target, robust=False)


def one_iteration(source, target):
    return plain(source, target, iterations=1)


def stays(source, target):
    return plain(source, target, stay=True)


def proud(source, target):
    return plain(source, target, spread=0.05)


def modest(source, target):
    return plain(source, target, spread=60.0)


def backwards(source, target):
    pose, cov = plain(source, target)
    return geometry.inverse(pose), cov


def changes(source, target):
    answer = plain(source, target)
    source += 1.0
    return answer


def pose_alone(source, target):
    return plain(source, target)[0]


def lopsided(source, target):
    pose, cov = plain(source, target)
    return pose, cov + np.triu(cov, 1)


def nan(source, target):
    return np.full(3, np.nan), np.eye(3)


def raises(source, target):
    raise IndexError("no partner")


def stub(source, target):
    raise NotImplementedError


judged = Judge(PROJECT, reference, range(8))


@pytest.mark.parametrize("design", [plain, reference])
def test_a_sound_icp_gets_full_marks_however_it_is_written(design):
    assert judged(design).mark >= 95


@pytest.mark.parametrize(
    ("design", "at_most", "finding"),
    [
        (points, 75, "too sure of itself"),
        (every_pair, 75, "m (the package"),
        (one_iteration, 92, "m (the package"),
        (stays, 20, "too sure of itself"),
        (proud, 70, "too sure of itself"),
        (modest, 70, "too modest"),
        (backwards, 20, "too sure of itself"),
        (changes, 90, "complete_icp() changes its arguments in place"),
        (pose_alone, 0, "returns two things"),
        (lopsided, 0, "cov is not symmetric"),
        (nan, 0, "pose holds NaN"),
        (raises, 0, "complete_icp() raised IndexError: no partner (first in run 1, step 0)"),
        (stub, 0, "Nothing here yet"),
    ],
)
def test_a_broken_icp_gets_the_mark_and_the_finding_that_it_deserves(design, at_most, finding):
    score = judged(design, runs=2)
    assert score.mark <= at_most
    assert finding in repr(score)


def test_the_picture_of_a_run_is_drawn():
    assert judged(plain).figure() is not None
