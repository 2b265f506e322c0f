"""Guess first: the reader commits to a number and to how sure they are, then learns the truth and their NEES."""

from __future__ import annotations

import hashlib
import html
import json
import math
from dataclasses import dataclass

from coursekit.teaching.explore.shell import part


@dataclass(frozen=True)
class Guess:
    """A question with a locked answer; the last line of a cell shows it, in the book and live.

    question : plain text.
    truth : the number that is asked for.
    sigma : the spread to score by, same unit; None asks the reader for their own, which is the better question.
    unit : "m", "%".
    why : a sentence that is shown with the truth.

    The guess stays in the reader's own browser, and a button takes it back.  Raises ValueError when ``truth`` is not
    finite or ``sigma`` not positive.
    """

    question: str
    truth: float
    sigma: float | None = None
    unit: str = ""
    why: str = ""

    def __post_init__(self) -> None:
        if not math.isfinite(self.truth):
            raise ValueError(f"truth: expected a finite number, got {self.truth}")
        if self.sigma is not None and not 0 < self.sigma < math.inf:
            raise ValueError(f"sigma: expected a positive number, got {self.sigma}")

    def _repr_html_(self) -> str:
        key = "guess-" + hashlib.sha256(self.question.encode()).hexdigest()[:12]
        says = {"key": key, "truth": float(self.truth), "unit": self.unit, "sigma": self.sigma}
        payload = json.dumps(says, ensure_ascii=False).replace("<", "\\u003c")
        unit, question = html.escape(self.unit), html.escape(self.question)
        spread = (
            '<label>give or take (your σ)<input name="spread" type="number" step="any" min="1e-9" required>'
            f"{unit}</label>"
            if self.sigma is None
            else ""
        )
        return (
            f'<div class="guess" role="group" aria-label="Guess first"><style>{part("guess.css")}</style>'
            f"<p><strong>Guess first.</strong> {question}</p>"
            '<form class="guess-form" autocomplete="off" hidden>'
            f'<label>Your guess<input name="guess" type="number" step="any" required>{unit}</label>{spread}'
            '<button type="submit">Lock it in</button></form>'
            f'<p class="guess-verdict" role="status"></p><p class="guess-why" hidden>{html.escape(self.why)}</p>'
            '<button type="button" class="guess-again" hidden>Guess again</button>'
            "<noscript><p>Write your guess down; the truth comes below.</p></noscript>"
            f"<script>({part('guess.js')})(document.currentScript.parentElement, {payload});</script></div>"
        )

    def __repr__(self) -> str:
        return f"Guess first. {self.question}"


def guess(question: str, truth: float, *, sigma: float | None = None, unit: str = "", why: str = "") -> Guess:
    """Ask before the answer is seen: ``guess("How far is it?", 2.5, unit="m")``.  See ``Guess``."""
    return Guess(question, truth, sigma, unit, why)
