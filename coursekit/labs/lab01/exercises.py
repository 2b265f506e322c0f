"""The checks of Lab 1: hue, edges between pixels, height and axis, the picture's end, and the floor."""

from __future__ import annotations

from typing import Any

import numpy as np

from coursekit.pinhole import COURSE_CAMERA, Camera, project_cylinder
from coursekit.teaching.exercises import call, close, exercise, expect


@exercise("lab01.hue_mask")
def hue_mask(answer: Any, rng: np.random.Generator) -> None:
    hsv = np.stack([rng.integers(0, 180, (12, 15)), rng.integers(0, 256, (12, 15)), rng.integers(0, 256, (12, 15))], -1)
    hsv = hsv.astype(np.uint8)
    plain = int(rng.integers(30, 120))
    cases = [(plain, plain + int(rng.integers(10, 40))), (int(rng.integers(166, 176)), int(rng.integers(5, 12)))]
    cases += [(0, 12), (160, 179), (plain, plain)]
    limits = [hue for low, high in cases[:2] for hue in (low, high, low - 1, high + 1, (low + high) // 2, 178, 2)]
    for row, s_and_v in enumerate(((200, 200), (40, 200), (200, 5), (120, 200), (200, 18))):
        hsv[row, :14] = [[hue, *s_and_v] for hue in limits]
    h, s, v = (hsv[..., k].astype(int) for k in range(3))
    coloured = (s >= 120) & (v >= 18)
    for low, high in cases:
        got = call(answer, hsv, low, high)
        hues = (h >= low) & (h <= high) if low <= high else (h >= low) | (h <= high)
        expect(np.shape(got) == h.shape, f"A mask has one entry per pixel: {h.shape}, yours is {np.shape(got)}.")
        expect(
            np.asarray(got).dtype == bool,
            f"A mask is made of booleans, yours of {np.asarray(got).dtype}: a comparison gives them.",
        )
        close(
            got,
            hues & coloured,
            misconceptions={
                "Red is empty: no hue is above 170 and below 8 at once. What lies between them on a circle?":
                    (h >= low) & (h <= high) & coloured,
                "You let every hue pass where the interval runs through 0.":
                    coloured if low > high else hues & coloured,
                "Grey pixels pass: without saturation a hue is an accident of the noise.": hues & (v >= 18),
                "Black pixels pass: in the dark a hue is an accident of the noise.": hues & (s >= 120),
                "Grey and black pixels pass: there a hue is an accident of the noise.": hues,
                "At least 120 and at least 18: a pixel that is exactly at a threshold counts.":
                    hues & (s > 120) & (v > 18),
                "The channels are bytes, and 3 - 10 is 249 in bytes: turn the hue into integers before you subtract.":
                    ((hsv[..., 0] - np.uint8(low)) % 180 <= (high - low) % 180) & coloured,
                "You moved `low` below zero, and hues are never there: those from 170 to 179 have to move with it.":
                    coloured & (h >= (low - 180 if low > high else low)) & (h <= high),
                "You moved `high` beyond 180, and hues are never there: those from 0 to 8 have to move with it.":
                    coloured & (h >= low) & (h <= (high + 180 if low > high else high)),
                "You took 170 … 8 for 8 … 170. The interval goes the short way, through 0.":
                    (h >= min(low, high)) & (h <= max(low, high)) & coloured,
                "Your mask is inside out.": ~(hues & coloured),
                "The limits belong to the interval: a pixel whose hue is exactly at one counts.":
                    ((h > low) & (h < high) if low <= high else (h > low) | (h < high)) & coloured,
            },
            otherwise="Three conditions on each pixel, joined by &: hue in the interval, saturation, value.",
        )  # fmt: skip


@exercise("lab01.subpixel_edge")
def subpixel_edge(answer: Any, rng: np.random.Generator) -> None:
    levels = rng.uniform(150, 220), rng.uniform(20, 90)
    _edge(answer, 24, *levels, rng.uniform(8, 11))  # where the two ends cannot be mixed up
    _edge(answer, 24, *levels[::-1], rng.uniform(13, 16))
    _edge(answer, int(rng.integers(12, 40)), *levels, rng.uniform(4, 8))


def _edge(answer: Any, n: int, outside: float, inside: float, edge: float) -> None:
    share = np.clip(np.arange(n) + 0.5 - edge, 0, 1)
    share = np.convolve(np.pad(share, 2, mode="edge"), [0.05, 0.2, 0.5, 0.2, 0.05], mode="valid")
    profile = outside + (inside - outside) * share
    total = share.sum()
    close(
        call(answer, profile, outside, inside),
        edge,
        misconceptions={
            "That is the first pixel past half way: right to half a pixel. Its neighbours know more.":
                float(np.argmax(share >= 0.5)),
            "The point where the share crosses one half listens to two pixels; the others saw the edge, too.":
                float(np.interp(0.5, share, np.arange(n))),
            "You are half a pixel off: pixel k reaches from k - ½ to k + ½.": n - total,
            "You are a whole pixel off: the last pixel of n is number n - 1, and it reaches half a pixel further.":
                n - 1.5 - total,
            "You counted from the last pixel's middle: it reaches half a pixel further.": n - 1 - total,
            "That is how many pixels are covered; the question is where the cover begins.": total,
            "You measured from the wrong end: the inside is on the right.": total - 0.5,
            "The shares run from 0 to 1 only after you subtract the outside and divide by the step.":
                n - 0.5 - (profile / inside).sum(),
        },
        otherwise="Turn grey levels into shares of cover and add them up: how far back from the right do they reach?",
        tolerance=1e-6,
    )  # fmt: skip


@exercise("lab01.height_and_axis")
def height_and_axis(answer: Any, rng: np.random.Generator) -> None:
    d, theta, side = rng.uniform(0.7, 1.1), rng.uniform(0.25, 0.4) * rng.choice([-1, 1]), rng.integers(2)
    pixels = project_cylinder(d, theta, COURSE_CAMERA, 0.4, 0.12)
    left, right, n = float(pixels.left_px), float(pixels.right_px), float(pixels.height_px)
    top = rng.uniform(40, 60)
    crowd = np.c_[np.full(9, (left, right)[side]), rng.uniform(top + 7, top + n - 7, 9)]
    rim = [[float(pixels.axis_px), top], [float(pixels.axis_px), top + n]]
    corners = rng.permutation(np.vstack([[[u, v] for u in (left, right) for v in (top + 6, top + n - 6)], crowd, rim]))
    u, camera = corners[:, 0], COURSE_CAMERA
    got = call(answer, corners, camera)
    expect(np.shape(got) == (2,), "Return two numbers: the height and the column of the axis.")
    bearings = camera.bearing([left, right])
    close(
        got,
        [n, pixels.axis_px],
        misconceptions={
            "The mean of all corners leans to the side that has more of them. Which corners tell where the edges are?":
                [n, u.mean()],
            "A median leans as well, only in jumps: most corners are on one side.": [n, np.median(u)],
            "That is the middle of the edges in pixels. Go half way in angle; camera.bearing and camera.column help.":
                [n, (left + right) / 2],
            "The axis is asked for as a column; you stopped at its bearing.": [n, bearings.mean()],
            "Height first, then the axis.": [pixels.axis_px, n],
            "The mean of all corners' angles leans like that of their columns. Which corners tell where the edges are?":
                [n, camera.column(camera.bearing(u).mean())],
            "The height is measured along v; corners are [u, v].": [right - left, pixels.axis_px],
            "You took columns for rows: corners are [u, v], and v runs down.":
                [right - left, camera.column(camera.bearing([top, top + n]).mean())],
            "The height is from the highest to the lowest corner; yours misses the rims.": [n - 12, pixels.axis_px],
            "You added a pixel. Corners are points on the outline, not pixels to be counted.": [n + 1, pixels.axis_px],
            "The height is a length: v runs down, so mind which end you subtract.": [-n, pixels.axis_px],
        },
        otherwise="Height: the spread of v. Axis: the two extremes of u, as angles, and half way between them.",
    )  # fmt: skip


@exercise("lab01.cut_off")
def cut_off(answer: Any, rng: np.random.Generator) -> None:
    camera, margin = Camera(500, 500, 399.5, 149.5, 800, 300), float(rng.uniform(2, 5))
    near = rng.uniform(0.1, 0.9, 4) * margin
    near[2] = margin - rng.uniform(0.1, 0.9)  # a program that takes the picture for one pixel wider misses this
    boxes = rng.uniform([60, 60, 500, 180], [300, 100, 700, 240], (6, 4))  # left, top, right, bottom
    boxes[1, 0], boxes[2, 1] = near[0], near[1]
    boxes[3, 2], boxes[4, 3] = camera.width - 1 - near[2], camera.height - 1 - near[3]
    boxes[5, :2] = near[:2]
    names, got = ["left", "top", "right", "bottom"], []
    for left, top, right, bottom in boxes:
        edges = call(answer, np.array([[left, top], [right, top], [right, bottom], [left, bottom]]), camera, margin)
        expect(not isinstance(edges, str), "Return a set of names: a landmark may be cut off by two edges at once.")
        expect(
            isinstance(edges, (set, frozenset, list, tuple)),
            f"Return a set of names, such as {{'left', 'top'}}, not {type(edges).__name__}.",
        )
        others = {str(edge) for edge in edges} - set(names)
        expect(not others, f"The names are 'left', 'right', 'top' and 'bottom'; yours have {sorted(others)}.")
        got.append([name in edges for name in names])

    w, h = camera.width - 1, camera.height - 1
    room = np.abs([0, 0, w, h] - boxes)
    cut = room < margin
    hints = {
        "The last pixel of a row is number camera.width - 1, that of a column camera.height - 1.":
            np.add(room, [0, 0, 1, 1]) < margin,
        "Columns end at camera.width and rows at camera.height; yours are swapped.":
            np.array([1, 1, -1, -1]) * (boxes - [0, 0, h, w]) < margin,
        "Top and bottom are swapped: v runs down, so small v is the top.":
            cut[:, [0, 3, 2, 1]],
        "Left and right are swapped: u runs to the right.": cut[:, [2, 1, 0, 3]],
        "The sides are right; a landmark that is close is cut off by the top or the bottom, too.":
            cut & [True, False, True, False],
        "You name the edges that are far enough away.": ~cut,
        "Your edges answer only when the landmark has left the picture: where does the margin come in?":
            np.zeros_like(cut),
    }  # fmt: skip
    close(got, cut, misconceptions=hints, tolerance=1e-9,
          otherwise="For each edge: how much room is there between it and the corner nearest to it?")  # fmt: skip


@exercise("lab01.depth_from_floor")
def depth_from_floor(answer: Any, rng: np.random.Generator) -> None:
    fx, fy = rng.uniform(400, 600), rng.uniform(700, 900)
    camera = Camera(fx, fy, 319.5, rng.uniform(200, 280), 640, 480)
    eye, r = rng.uniform(0.15, 0.6), rng.uniform(0.08, 0.2)
    depth = rng.uniform(1.0, 8.0, 5)
    bottom = camera.cy + fy * eye / (depth - r)
    close(
        call(answer, bottom, camera, eye, r),
        depth,
        misconceptions={
            "That is the depth of the near rim, which stands on the lowest pixel. The axis is one radius behind.":
                depth - r,
            "The axis is behind the near rim, not before it.": depth - 2 * r,
            "Rows count from the top of the picture; the horizon is at c_y.": fy * eye / bottom + r,
            "Rows belong to f_y, columns to f_x.": fx * eye / (bottom - camera.cy) + r,
            "Below the horizon v is larger than c_y: your depths come out negative.":
                fy * eye / (camera.cy - bottom) + r,
            "Your ratio is upside down: what is lower in the picture is nearer.":
                (bottom - camera.cy) / (fy * eye) + r,
        },
        otherwise="A point of the floor has z = -eye. Put that into v = c_y - f_y z / x and solve for x.",
    )  # fmt: skip
