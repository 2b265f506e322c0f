"""Figures that the reader touches: drag a handle, or focus it and use the arrow keys, and the drawing answers.

``touch("ranging")`` shows a light scene as plain JavaScript on SVG: continuous values, no kernel, the same in the
book and in JupyterLab.  The few functions that the figures share stand in ``robotics.js``, a translation of the
package's own that a test holds equal to them; what all figures do (axes, handles, the spoken sentence) in ``kit.js``;
each scene is one file of its own name.
"""

from __future__ import annotations

import hashlib
import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

SCENES = {
    "arc": "Two wheels make an arc",
    "banana": "Why uncertainty bends",
    "ranging": "What a camera measures",
    "filter": "One correction in one dimension",
    "gate": "One correction in the plane, and its gate",
    "pairs": "One step of ICP",
    "resampling": "Systematic resampling",
    "cloud": "A small cloud and one beacon",
}
HINT = (
    "Drag an orange handle, or move to it with Tab and use the arrow keys (with Shift: ten times as far; Home and End: "
    "as far as it goes)."
)


@dataclass(frozen=True)
class Touch:
    """A touched figure; the last line of a cell shows it.  ``scene``: one of ``SCENES``; ``alt``: what it shows."""

    scene: str
    alt: str

    def __post_init__(self) -> None:
        if self.scene not in SCENES:
            raise ValueError(f"scene: expected one of {', '.join(SCENES)}, got {self.scene!r}")
        if not isinstance(self.alt, str) or not self.alt.strip():
            raise ValueError(f"alt: expected a sentence that says what the figure shows, got {self.alt!r}")

    def _repr_html_(self) -> str:
        return _figure(SCENES[self.scene], self.alt, f"{self.scene}.js")

    def __repr__(self) -> str:
        return f"<touched figure: {SCENES[self.scene]}>"


def part(name: str) -> str:
    """One of the files, without the comment that opens it."""
    lines = files("coursekit.teaching.touch").joinpath(name).read_text(encoding="utf-8").strip().splitlines()
    while lines[0].startswith("//"):
        del lines[0]
    return "\n".join(lines)


def touch(scene: str, *, alt: str) -> Touch:
    """Show a touched figure.

    Raises ValueError for a scene that is none of ``SCENES`` and for an empty ``alt``.

    >>> touch("ranging", alt="A landmark ahead and to the left of a camera, with its range and bearing.")
    <touched figure: What a camera measures>
    """
    return Touch(scene, alt)


@dataclass(frozen=True)
class Region:
    """Guess first, on a drawing; see ``guess_point`` and ``guess_ellipse``."""

    question: str
    extent: tuple[float, float, float, float]
    truth: np.ndarray
    ellipse: bool
    scenery: Sequence[tuple[str, ArrayLike] | tuple[str, ArrayLike, str]] = ()
    unit: str = "m"
    why: str = ""

    def __post_init__(self) -> None:
        truth = np.atleast_2d(np.asarray(self.truth, dtype=float))
        if truth.ndim != 2 or truth.shape[1] != 2 or not np.isfinite(truth).all():
            raise ValueError(f"truth: expected finite points (n, 2), got shape {truth.shape}")
        left, right, bottom, top = self.extent
        if not (left < right and bottom < top):
            raise ValueError(f"extent: expected left < right and bottom < top, got {self.extent}")
        object.__setattr__(self, "truth", truth)

    def _repr_html_(self) -> str:
        scenery = [
            {"kind": kind, "points": np.asarray(points, dtype=float).tolist(), "text": " ".join(text)}
            for kind, points, *text in self.scenery
        ]
        key = "region-" + hashlib.sha256(self.question.encode()).hexdigest()[:12]
        data = {"key": key, "extent": self.extent, "scenery": scenery, "cloud": self.truth.round(4).tolist()}
        before = f"<p><strong>Guess first.</strong> {html.escape(self.question)}</p>"
        after = f'<p class="region-why" hidden>{html.escape(self.why)}</p>'
        data |= {"ellipse": self.ellipse, "unit": self.unit}
        return _figure("Guess first", self.question, "region.js", data, before, after)

    def __repr__(self) -> str:
        return f"Guess first. {self.question}"


def guess_point(question: str, truth: ArrayLike, *, extent: tuple[float, float, float, float], **more: Any) -> Region:
    """Ask for a place before the answer is seen: the reader drags a handle, locks it in, and learns how far off it was.

    Parameters
    ----------
    question : plain text.
    truth : [x, y], in the drawing's own units.
    extent : what the drawing shows, (left, right, bottom, top).
    scenery : (kind, points (n, 2)), drawn as lines; a kind is a colour of the course, as in "truth thin dashed".
        A third entry is a text at the first point. For the kind "robot truth" the points are poses (n, 3).
    unit : of the drawing, "m" by default.     why : a sentence that is shown with the truth.

    The guess stays in the reader's own browser.  Raises ValueError for points that are not finite, for an empty extent.

    >>> guess_point("Where does the robot stand after 10 s?", [4.2, 1.1], extent=(0, 6, -2, 2))
    Guess first. Where does the robot stand after 10 s?
    """
    return Region(question, extent, np.asarray(truth, dtype=float).reshape(1, -1), ellipse=False, **more)


def guess_ellipse(question: str, truth: ArrayLike, *, extent: tuple[float, float, float, float], **more: Any) -> Region:
    """Ask for an ellipse that should hold 95 % of the points ``truth`` (n, 2); scored by their share and by the mean of
    their squared distances in σ, 2 for the right ellipse.

    Arguments as ``guess_point``.

    >>> rng = np.random.default_rng(0)
    >>> guess_ellipse("Where will the robots stop?", rng.normal(size=(300, 2)), extent=(-6, 6, -4, 4))
    Guess first. Where will the robots stop?
    """
    return Region(question, extent, np.asarray(truth, dtype=float), ellipse=True, **more)


def _figure(
    title: str, alt: str, scene: str, data: Mapping[str, Any] | None = None, before: str = "", after: str = ""
) -> str:
    """One self-contained piece of HTML around a scene's function (root, mathematics and kit, its data)."""
    title, alt = html.escape(title, quote=True), html.escape(alt, quote=True)
    # "<" is escaped so that no text can end the script element early.
    payload = json.dumps(data or {}, ensure_ascii=False).replace("<", "\\u003c")
    mathematics = f"Object.assign(({part('robotics.js')})(), {{ kit: {part('kit.js')} }})"
    return (
        f'<div class="touch" role="group" aria-label="{title}"><style>{part("touch.css")}</style>{before}'
        f'<p class="touch-hint" hidden>{HINT}</p><svg role="group" aria-label="{alt}"></svg>'
        '<p class="touch-result"></p><div class="touch-buttons"></div>'
        f'<p class="touch-words" aria-live="polite"></p>{after}'
        f"<noscript><p>This figure needs scripts. It shows: {alt}</p></noscript><script>((root) => {{"
        f" root.querySelector('.touch-hint').hidden = false; ({part(scene)})(root, {mathematics}, {payload});"
        " })(document.currentScript.parentElement);</script></div>"
    )
