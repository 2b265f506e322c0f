"""Lab 8: who must pass, who must fail, and with which hint."""

import numpy as np
from scipy.cluster.vq import kmeans, vq
from scipy.special import logsumexp

from coursekit import visual
from coursekit.geometry import wrap_angle
from coursekit.particles import Particles
from tests.labs.answers import Answers


def stub(*arguments):
    raise NotImplementedError


def by_hand(pose):
    u, v, yaw = pose
    theta = np.pi / 2 - yaw
    return np.array([u, -v, np.arctan2(np.sin(theta), np.cos(theta))])


def frame(flip=-1, theta=lambda yaw: wrap_angle(np.pi / 2 - yaw), swap=False):
    def convert(pose):
        u, v, yaw = pose
        return np.array([flip * v, u, theta(yaw)]) if swap else np.array([u, flip * v, theta(yaw)])

    return convert


def through(H, u, v):
    x, y, w = H @ [u, v, 1.0]
    return np.array([x / w, y / w])


def from_homography(
    centre=lambda h, w: ((w - 1) / 2, (h - 1) / 2), yaw=lambda H: np.arctan2(H[1, 0] / H[2, 2], H[0, 0] / H[2, 2])
):
    def pose(H, shape):
        return np.array([*through(H, *centre(*shape)), yaw(H)])

    return pose


def by_corners(H, shape):
    h, w = shape
    corners = [through(H, u, v) for u in (0, w - 1) for v in (0, h - 1)]
    ahead = through(H, (w - 1) / 2, 0) - np.mean(corners, axis=0)
    return np.array([*np.mean(corners, axis=0), np.arctan2(ahead[0], -ahead[1])])


def not_divided(H, shape):
    h, w = shape
    return np.array([*(H @ [(w - 1) / 2, (h - 1) / 2, 1.0])[:2], np.arctan2(H[1, 0], H[0, 0])])


def share(P, R):
    return np.sqrt(np.linalg.det(R) * np.linalg.det(R + 2 * P)) / np.linalg.det(R + P)


def share_by_axes(P, R):
    """Along the axes in which the fix is a unit ball and the cloud is not slanted."""
    whitened = np.linalg.solve(np.linalg.cholesky(R), np.linalg.cholesky(P))
    ratio = np.linalg.svd(whitened, compute_uv=False) ** 2
    return np.prod(np.sqrt(1 + 2 * ratio) / (1 + ratio))


def mixture(log_prior, log_fix, log_likelihood, share):
    return log_prior + log_likelihood - np.logaddexp(np.log1p(-share) + log_prior, np.log(share) + log_fix)


def mixture_normalised(log_prior, log_fix, log_likelihood, share):
    below = logsumexp([log_prior, log_fix], axis=0, b=[[1 - share], [share]])
    logs = log_prior + log_likelihood - below
    return logs - logsumexp(logs)


def underflowing(log_prior, log_fix, log_likelihood, share):
    with np.errstate(all="ignore"):
        below = (1 - share) * np.exp(log_prior) + share * np.exp(log_fix)
        return np.log(np.exp(log_prior) * np.exp(log_likelihood) / below)


def underflowing_below(log_prior, log_fix, log_likelihood, share):
    with np.errstate(all="ignore"):
        below = (1 - share) * np.exp(log_prior) + share * np.exp(log_fix)
        return log_prior + log_likelihood - np.log(below)


def clump(states, weights):
    return visual.dominant_cluster(Particles(states, np.log(weights), angles=(2,))).mean


def scale_of(H):
    return np.hypot(*H[:2, 0]) / abs(H[2, 2])


def mean_pose(states, weights):
    w = weights / weights.sum()
    return np.array([*(w @ states[:, :2]), np.arctan2(w @ np.sin(states[:, 2]), w @ np.cos(states[:, 2]))])


def apart(states):
    return np.linalg.norm(states[:, None, :2] - states[None, :, :2], axis=-1)


def group(states, weights):
    """The states near the one with the most weight near it, and their weights, which sum to one."""
    d = apart(states)
    near = d[np.argmax((d < 60) @ weights)] < 60
    return states[near], weights[near] / weights[near].sum()


def neighbours(states, weights):
    return mean_pose(*group(states, weights))


def k_means(states, weights):
    """Three groups, from starts that are far apart."""
    starts = [states[0, :2]]
    while len(starts) < 3:
        starts.append(states[np.linalg.norm(states[:, None, :2] - starts, axis=-1).min(axis=1).argmax(), :2])
    places, _ = kmeans(states[:, :2], np.array(starts))
    label = vq(states[:, :2], places)[0]
    best = label == np.argmax(np.bincount(label, weights=weights))
    return mean_pose(states[best], weights[best])


def grid(states, weights, cell, refined):
    """The heaviest cell of a fixed grid; refined: from there to the mean of all within one cell, some times."""
    keys = np.floor(states[:, :2] / cell).astype(int)
    _, index = np.unique(keys, axis=0, return_inverse=True)
    best = index.ravel() == np.bincount(index.ravel(), weights=weights).argmax()
    for _ in range(5 if refined else 0):
        best = np.hypot(*(states[:, :2] - mean_pose(states[best], weights[best])[:2]).T) < cell
    return mean_pose(states[best], weights[best])


def refined_grid(states, weights):
    return grid(states, weights, 60, refined=True)


ANSWERS = {
    "lab08.odometry_from_image": Answers(
        stub=stub,
        reference=visual.odometry_from_image,
        second=by_hand,
        wrong={
            "not wrapped": (frame(theta=lambda yaw: np.pi / 2 - yaw), "off by a whole turn"),
            "v kept": (frame(flip=1), "v grows downwards"),
            "origin at the bottom": (lambda pose: frame(flip=-1)(pose) + np.array([0, 800, 0]), "origin stays"),
            "sense of rotation kept": (frame(theta=lambda yaw: wrap_angle(yaw + np.pi / 2)), "must shrink"),
            "zero kept": (frame(theta=lambda yaw: wrap_angle(-yaw)), "must not get heading zero"),
            "quarter turn the wrong way": (frame(theta=lambda yaw: wrap_angle(-np.pi / 2 - yaw)), "the wrong way"),
            "axes swapped": (frame(swap=True), "not swapped"),
        },
        both={
            "v kept, not wrapped": (
                frame(flip=1, theta=lambda yaw: np.pi / 2 - yaw),
                ("off by a whole turn", "v grows downwards"),
            ),
            "v kept, zero kept": (
                frame(flip=1, theta=lambda yaw: wrap_angle(-yaw)),
                ("v grows downwards", "must not get heading zero"),
            ),
            "axes swapped, sense of rotation kept": (
                frame(swap=True, theta=lambda yaw: wrap_angle(yaw + np.pi / 2)),
                ("not swapped", "must shrink"),
            ),
        },
    ),
    "lab08.pose_from_homography": Answers(
        stub=stub,
        reference=from_homography(),
        second=by_corners,
        wrong={
            "half a pixel": (from_homography(lambda h, w: (w / 2, h / 2)), "Half a pixel off"),
            "the corner": (from_homography(lambda h, w: (0, 0)), "corner lands"),
            "no division": (not_divided, "up to a factor"),
            "rows first": (from_homography(lambda h, w: ((h - 1) / 2, (w - 1) / 2)), "one of them has to be turned"),
            "anticlockwise": (from_homography(yaw=lambda H: np.arctan2(-H[1, 0], H[0, 0])), "clockwise already"),
            "arguments of arctan2": (from_homography(yaw=lambda H: np.arctan2(H[0, 0], H[1, 0])), "is the cosine?"),
            "sign of the factor": (
                from_homography(yaw=lambda H: np.arctan2(H[1, 0], H[0, 0])),
                "factor may be negative",
            ),
            "arc cosine": (
                from_homography(yaw=lambda H: np.arccos(np.clip(H[0, 0] / H[2, 2], -1, 1))),
                "arc cosine of it",
            ),
            "arc sine": (
                from_homography(yaw=lambda H: np.arcsin(np.clip(H[1, 0] / H[2, 2], -1, 1))),
                "arc sine of it",
            ),
            "arc tangent": (from_homography(yaw=lambda H: np.arctan(H[1, 0] / H[0, 0])), "from its opposite"),
            "cosine alone": (
                from_homography(yaw=lambda H: np.arccos(H[0, 0] / H[2, 2] / scale_of(H))),
                "left turn from a right one",
            ),
            "sine alone": (
                from_homography(yaw=lambda H: np.arcsin(H[1, 0] / H[2, 2] / scale_of(H))),
                "its mirror image",
            ),
        },
        both={
            "half a pixel, arc tangent": (
                from_homography(lambda h, w: (w / 2, h / 2), lambda H: np.arctan(H[1, 0] / H[0, 0])),
                ("Half a pixel off", "from its opposite"),
            ),
            "rows first, half a pixel": (
                from_homography(lambda h, w: (h / 2, w / 2)),
                ("Half a pixel off", "one of them has to be turned"),
            ),
            "the corner, anticlockwise": (
                from_homography(lambda h, w: (0, 0), lambda H: np.arctan2(-H[1, 0], H[0, 0])),
                ("corner lands", "clockwise already"),
            ),
        },
    ),
    "lab08.effective_share": Answers(
        stub=stub,
        reference=share,
        second=share_by_axes,
        wrong={
            "diagonals only": (lambda P, R: share(P * np.eye(3), R * np.eye(3)), "beside the diagonal"),
            "variances as deviations": (
                lambda P, R: share(P**2 * np.eye(3), R**2 * np.eye(3)),
                "taken for standard deviations",
            ),
            "mean weight": (lambda P, R: np.sqrt(np.linalg.det(R) / np.linalg.det(R + P)), "the mean weight"),
            "mean square": (lambda P, R: np.sqrt(np.linalg.det(R) / np.linalg.det(R + 2 * P)), "That is E[w²]"),
            "no root": (lambda P, R: share(P, R) ** 2, "root of the determinant"),
            "limit": (lambda P, R: np.sqrt(8 * np.linalg.det(R) / np.linalg.det(P)), "that is the limit"),
            "swapped": (lambda P, R: share(R, P), "changed places"),
            "inverse": (lambda P, R: 1 / share(P, R), "Upside down"),
        },
        both={
            "swapped, no root": (lambda P, R: share(R, P) ** 2, ("changed places", "root of the determinant")),
            "inverse, no root": (lambda P, R: 1 / share(P, R) ** 2, ("Upside down", "root of the determinant")),
        },
    ),
    "lab08.mixture_log_weights": Answers(
        stub=stub,
        reference=mixture,
        second=mixture_normalised,
        wrong={
            "underflow": (underflowing, "Zero over zero"),
            "underflow below": (underflowing_below, "logarithm of zero"),
            "share times a log": (lambda p, f, z, s: p + z - np.logaddexp((1 - s) * p, s * f), "its own logarithm"),
            "normalised weights": (lambda p, f, z, s: np.exp(mixture_normalised(p, f, z, s)), "add up to one"),
            "shares swapped": (lambda p, f, z, s: mixture(p, f, z, 1 - s), "shares have changed places"),
            "only the fix below": (lambda p, f, z, s: p + z - f, "leave out neither"),
            "plain filter": (lambda p, f, z, s: z.copy(), "the plain filter"),
            "no prior": (lambda p, f, z, s: mixture(p, f, z, s) - p, "nobody asked the motion"),
            "no likelihood": (lambda p, f, z, s: mixture(p, f, z, s) - z, "missing from the numerator"),
            "sum of logs": (lambda p, f, z, s: p + z - (1 - s) * p - s * f, "geometric mean"),
            "weights": (lambda p, f, z, s: np.exp(mixture(p, f, z, s)), "asked for their logs"),
        },
        both={
            "no prior, shares swapped": (
                lambda p, f, z, s: mixture(p, f, z, 1 - s) - p,
                ("nobody asked the motion", "shares have changed places"),
            ),
            "no likelihood, shares swapped": (
                lambda p, f, z, s: mixture(p, f, z, 1 - s) - z,
                ("missing from the numerator", "shares have changed places"),
            ),
            "neither prior nor likelihood": (
                lambda p, f, z, s: mixture(p, f, z, s) - z - p,
                ("missing from the numerator", "nobody asked the motion"),
            ),
        },
    ),
    "lab08.best_estimate": Answers(
        stub=stub,
        reference=clump,
        second=neighbours,
        more=[k_means, refined_grid],
        wrong={
            "greatest weight": (lambda s, w: s[np.argmax(w)].copy(), "particle of greatest weight"),
            "mean": (lambda s, w: w @ s, "mean of the whole cloud"),
            "plain mean": (lambda s, w: s.mean(axis=0), "no notice of the weights"),
            "most particles": (lambda s, w: neighbours(s, np.full(len(w), 1 / len(w))), "go where the most weight is"),
            "one of the group": (
                lambda s, w: s[np.argmax((apart(s) < 60) @ w)],
                "one particle of it",
            ),
            "plain mean of headings": (
                lambda s, w: np.r_[neighbours(s, w)[:2], group(s, w)[1] @ group(s, w)[0][:, 2]],
                "points backwards",
            ),
            "no weights in the group": (
                lambda s, w: np.r_[group(s, w)[0][:, :2].mean(axis=0), neighbours(s, w)[2]],
                "weigh them there as well",
            ),
        },
        both={
            **{
                f"a grid of {cell} pixels": (
                    lambda s, w, cell=cell: grid(s, w, cell, refined=False),
                    ("a fixed grid may have cut",),
                )
                for cell in (20, 50, 60, 80, 100, 200)
            },
            "plain mean of the whole cloud's crowd": (
                lambda s, w: np.median(s, axis=0),
                ("go where the most weight is",),
            ),
        },
    ),
}
