"""Right and wrong answers to the exercises of Lab 1."""

import numpy as np

from tests.labs.answers import Answers


def stub(*arguments):
    raise NotImplementedError


def channels(hsv):
    return (hsv[..., k].astype(int) for k in range(3))


def reference_mask(hsv, low, high):
    h, s, v = channels(hsv)
    hue = (low <= h) & (h <= high) if low <= high else (h >= low) | (h <= high)
    return hue & (s >= 120) & (v >= 18)


def circular_mask(hsv, low, high):
    """By distance along the circle: one line for both cases."""
    h, s, v = channels(hsv)
    return np.logical_and.reduce([(h - low) % 180 <= (high - low) % 180, s > 119, v > 17])


def mask_without_wrap(hsv, low, high):
    h, s, v = channels(hsv)
    return (low <= h) & (h <= high) & (s >= 120) & (v >= 18)


def mask_of_any_hue(hsv, low, high):
    h, s, v = channels(hsv)
    return ((low <= h) | (h <= high) if low > high else (low <= h) & (h <= high)) & (s >= 120) & (v >= 18) | (
        (s >= 120) & (v >= 18) if low > high else np.zeros(h.shape, bool)
    )


def mask_of_grey(hsv, low, high):
    h, _, v = channels(hsv)
    return ((h - low) % 180 <= (high - low) % 180) & (v >= 18)


def mask_of_black(hsv, low, high):
    h, s, _ = channels(hsv)
    return ((h - low) % 180 <= (high - low) % 180) & (s >= 120)


def mask_open(hsv, low, high):
    h, s, v = channels(hsv)
    return ((h > low) & (h < high) if low <= high else (h > low) | (h < high)) & (s >= 120) & (v >= 18)


def mask_strict(hsv, low, high):
    h, s, v = channels(hsv)
    return ((h - low) % 180 <= (high - low) % 180) & (s > 120) & (v > 18)


def mask_in_bytes(hsv, low, high):
    h, s, v = hsv[..., 0], hsv[..., 1], hsv[..., 2]
    return ((h - low) % 180 <= (high - low) % 180) & (s >= 120) & (v >= 18)


def mask_the_long_way(hsv, low, high):
    return mask_without_wrap(hsv, min(low, high), max(low, high))


def mask_in_place(hsv, low, high):
    mask = reference_mask(hsv, low, high)
    hsv[~mask] = 0
    return mask


def shares(profile, outside, inside):
    return (profile - outside) / (inside - outside)


def reference_edge(profile, outside, inside):
    return len(profile) - 0.5 - np.sum(shares(profile, outside, inside))


def loop_edge(profile, outside, inside):
    at = -0.5
    for grey in profile:
        at += 1 - (grey - outside) / (inside - outside)
    return at


def ends(corners):
    return corners[:, 0].min(), corners[:, 0].max()


def axis(corners, camera):
    return camera.column(np.mean(camera.bearing(np.array(ends(corners)))))


def height(corners):
    return np.ptp(corners[:, 1])


def axis_by_hand(corners, camera):
    left, right = ends(corners)
    half = 0.5 * (np.arctan((camera.cx - left) / camera.fx) + np.arctan((camera.cx - right) / camera.fx))
    return max(v for _, v in corners) - min(v for _, v in corners), camera.cx - camera.fx * np.tan(half)


def height_of_the_sides(corners, camera):
    left, right = ends(corners)
    sides = corners[(corners[:, 0] == left) | (corners[:, 0] == right)]
    return height(sides), axis(corners, camera)


def rooms(corners, camera):
    (left, top), (right, bottom) = corners.min(axis=0), corners.max(axis=0)
    return {"left": left, "right": camera.width - 1 - right, "top": top, "bottom": camera.height - 1 - bottom}


def reference_cut(corners, camera, margin):
    return {edge for edge, room in rooms(corners, camera).items() if room < margin}


def loop_cut(corners, camera, margin):
    cut = []
    for u, v in corners:
        cut += ["left"] if u < margin else ["right"] if u > camera.width - 1 - margin else []
        cut += ["top"] if v < margin else ["bottom"] if v > camera.height - 1 - margin else []
    return sorted(set(cut))


def swapped(corners, camera, margin, names):
    other = dict(zip(names, names[::-1], strict=True))
    return {other.get(edge, edge) for edge in reference_cut(corners, camera, margin)}


def cut_with_sizes_swapped(corners, camera, margin):
    (left, top), (right, bottom) = corners.min(axis=0), corners.max(axis=0)
    room = {"left": left, "right": camera.height - 1 - right, "top": top, "bottom": camera.width - 1 - bottom}
    return {edge for edge in room if room[edge] < margin}


def cut_at_the_size(corners, camera, margin):
    (left, top), (right, bottom) = corners.min(axis=0), corners.max(axis=0)
    room = {"left": left, "right": camera.width - right, "top": top, "bottom": camera.height - bottom}
    return {edge for edge in room if room[edge] < margin}


def floor_depth(bottom, camera, eye):
    return camera.fy * eye / (bottom - camera.cy)


ANSWERS = {
    "lab01.hue_mask": Answers(
        stub=stub,
        reference=reference_mask,
        second=circular_mask,
        wrong={
            "no wrap": (mask_without_wrap, "Red is empty"),
            "any hue": (mask_of_any_hue, "every hue pass"),
            "no saturation": (mask_of_grey, "Grey pixels pass"),
            "no value": (mask_of_black, "Black pixels pass"),
            "inside out": (lambda *a: ~reference_mask(*a), "inside out"),
            "open interval": (mask_open, "limits belong"),
            "thresholds left out": (mask_strict, "exactly at a threshold"),
            "bytes": (mask_in_bytes, "channels are bytes"),
            "the long way": (mask_the_long_way, "the short way"),
            "not booleans": (lambda *a: 255 * reference_mask(*a).astype(np.uint8), "made of booleans"),
            "changed in place": (mask_in_place, "changes its argument"),
            "low moved below zero": (
                lambda hsv, low, high: mask_without_wrap(hsv, low - 180 if low > high else low, high),
                "those from 170 to 179",
            ),
            "high moved beyond 180": (
                lambda hsv, low, high: mask_without_wrap(hsv, low, high + 180 if low > high else high),
                "those from 0 to 8",
            ),
        },
        both={
            "no wrap, no saturation": (
                lambda hsv, low, high: (hsv[..., 0] >= low) & (hsv[..., 0] <= high) & (hsv[..., 2] >= 18),
                ("Grey pixels", "Red is empty"),
            ),
            "neither saturation nor value": (
                lambda hsv, low, high: (hsv[..., 0].astype(int) - low) % 180 <= (high - low) % 180,
                ("Grey and black",),
            ),
            "open interval, thresholds left out": (
                lambda *a: mask_open(*a) & mask_strict(*a),
                ("limits belong", "exactly at a threshold"),
            ),
        },
    ),
    "lab01.subpixel_edge": Answers(
        stub=stub,
        reference=reference_edge,
        second=loop_edge,
        wrong={
            "whole pixel": (lambda *a: float(np.argmax(shares(*a) >= 0.5)), "past half way"),
            "half way": (lambda *a: float(np.interp(0.5, shares(*a), np.arange(len(a[0])))), "listens to two pixels"),
            "half a pixel": (lambda *a: reference_edge(*a) + 0.5, "half a pixel off"),
            "last pixel's middle": (lambda *a: reference_edge(*a) - 0.5, "counted from the last"),
            "fence post": (lambda *a: reference_edge(*a) - 1, "a whole pixel off"),
            "covered length": (lambda *a: shares(*a).sum(), "how many pixels are covered"),
            "wrong end": (lambda *a: shares(*a).sum() - 0.5, "wrong end"),
            "no outside": (lambda p, o, i: len(p) - 0.5 - (p / i).sum(), "subtract the outside"),
        },
        both={
            "no outside, half a pixel": (
                lambda p, o, i: len(p) - (p / i).sum(),
                ("subtract the outside", "half a pixel off"),
            ),
            "covered length, negative": (lambda *a: -shares(*a).sum(), ("how many pixels are covered",)),
        },
    ),
    "lab01.height_and_axis": Answers(
        stub=stub,
        reference=lambda corners, camera: (height(corners), axis(corners, camera)),
        second=axis_by_hand,
        wrong={
            "mean": (lambda c, camera: (height(c), c[:, 0].mean()), "leans to the side"),
            "median": (lambda c, camera: (height(c), np.median(c[:, 0])), "A median leans"),
            "middle in pixels": (lambda c, camera: (height(c), np.mean(ends(c))), "half way in angle"),
            "a bearing": (
                lambda c, camera: (height(c), camera.bearing(np.array(ends(c))).mean()),
                "stopped at its bearing",
            ),
            "order": (lambda c, camera: (axis(c, camera), height(c)), "Height first"),
            "mean of all angles": (
                lambda c, camera: (height(c), camera.column(camera.bearing(c[:, 0]).mean())),
                "all corners' angles",
            ),
            "width for height": (lambda c, camera: (np.ptp(c[:, 0]), axis(c, camera)), "along v"),
            "columns for rows": (lambda c, camera: (height(c[:, ::-1]), axis(c[:, ::-1], camera)), "columns for rows"),
            "no rims": (height_of_the_sides, "misses the rims"),
            "a pixel added": (lambda c, camera: (height(c) + 1, axis(c, camera)), "added a pixel"),
            "negative": (lambda c, camera: (-height(c), axis(c, camera)), "is a length"),
        },
        both={
            "mean, a pixel added": (
                lambda c, camera: (height(c) + 1, c[:, 0].mean()),
                ("leans to the side", "added a pixel"),
            ),
            "no rims, middle in pixels": (
                lambda c, camera: (height_of_the_sides(c, camera)[0], np.mean(ends(c))),
                ("misses the rims", "half way in angle"),
            ),
            "order, median": (lambda c, camera: (np.median(c[:, 0]), height(c)), ("Height first", "A median leans")),
        },
    ),
    "lab01.cut_off": Answers(
        stub=stub,
        reference=reference_cut,
        second=loop_cut,
        wrong={
            "no margin": (lambda c, camera, m: reference_cut(c, camera, 0.0), "where does the margin"),
            "one pixel too many": (cut_at_the_size, "The last pixel"),
            "sizes swapped": (cut_with_sizes_swapped, "yours are swapped"),
            "top and bottom": (lambda *a: swapped(*a, ("top", "bottom")), "Top and bottom"),
            "left and right": (lambda *a: swapped(*a, ("left", "right")), "Left and right"),
            "sides only": (lambda *a: reference_cut(*a) & {"left", "right"}, "The sides are right"),
            "inverted": (lambda *a: {"left", "right", "top", "bottom"} - reference_cut(*a), "far enough away"),
            "one name": (lambda *a: "left", "a set of names: a landmark"),
            "a boolean": (lambda *a: bool(reference_cut(*a)), "not bool"),
            "other names": (lambda *a: {edge.title() for edge in reference_cut(*a)}, "The names are"),
        },
        both={
            "sides only, swapped": (
                lambda *a: swapped(*a, ("left", "right")) & {"left", "right"},
                ("The sides are right", "Left and right"),
            ),
            "both swapped": (
                lambda *a: {
                    {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}[e] for e in reference_cut(*a)
                },
                ("Left and right", "Top and bottom"),
            ),
            "inverted, top and bottom": (
                lambda *a: {"left", "right", "top", "bottom"} - swapped(*a, ("top", "bottom")),
                ("far enough away", "Top and bottom"),
            ),
        },
    ),
    "lab01.depth_from_floor": Answers(
        stub=stub,
        reference=lambda bottom, camera, eye, r: floor_depth(bottom, camera, eye) + r,
        second=lambda bottom, camera, eye, r: np.array([eye / ((b - camera.cy) / camera.fy) + r for b in bottom]),
        wrong={
            "near rim": (lambda b, camera, eye, r: floor_depth(b, camera, eye), "stands on the lowest pixel"),
            "radius subtracted": (lambda b, camera, eye, r: floor_depth(b, camera, eye) - r, "not before it"),
            "no horizon": (lambda b, camera, eye, r: camera.fy * eye / b + r, "count from the top"),
            "wrong focal length": (lambda b, camera, eye, r: camera.fx * eye / (b - camera.cy) + r, "Rows belong"),
            "sign": (lambda b, camera, eye, r: r - floor_depth(b, camera, eye), "come out negative"),
            "upside down": (lambda b, camera, eye, r: 1 / floor_depth(b, camera, eye) + r, "upside down"),
        },
        both={
            "wrong focal length, no radius": (
                lambda b, camera, eye, r: camera.fx * eye / (b - camera.cy),
                ("Rows belong", "stands on the lowest pixel"),
            ),
            "no horizon, radius subtracted": (
                lambda b, camera, eye, r: camera.fy * eye / b - r,
                ("count from the top", "not before it"),
            ),
        },
    ),
}
