"""How a score looks in a notebook: a card with the mark, the rubric, the findings and a picture."""

from __future__ import annotations

import html
from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def score_card(
    title: str,
    mark: int,
    lines: Sequence[tuple[str, float, int, str]],
    findings: Sequence[str],
    seconds: tuple[float, float],
    figure: Figure | None,
) -> str:
    """A self-contained piece of HTML.  Colours follow the page's text, so that it reads in light and dark.

    lines : of the rubric, (label, points, of how many, sentence).
    seconds : median time of a call, the design's and the package's; NaN where there is none.
    """
    rows = "".join(
        f"<tr><td style='text-align:left'>{html.escape(label)}</td><td>{points:.1f}&nbsp;of&nbsp;{most}</td>"
        f"<td style='text-align:left'>{html.escape(why)}</td></tr>"
        for label, points, most, why in lines
    )
    said = "".join(f"<li>{html.escape(finding)}</li>" for finding in findings)
    said = (
        f"<p style='margin:.6em 0 .2em'><b>What went wrong, first things first</b></p><ul>{said}</ul>" if said else ""
    )
    mine, package = seconds
    pace = f"<p>Median time of a call: {_time(mine)} (the package: {_time(package)}).</p>" if mine > 0 else ""
    picture = ""
    if figure is not None:
        figure.savefig(png := BytesIO(), format="png", dpi=110)
        picture = (
            "<img style='max-width:100%' alt='One run of your design beside the package’s'"
            f" src='data:image/png;base64,{b64encode(png.getvalue()).decode()}'>"
        )
    colour = "#1b7f4b" if mark >= 80 else "#b3541e"
    return (
        f"<div role='status' style='border-left:.35em solid {colour};padding:.5em .9em;margin:.3em 0'>"
        f"<b style='color:{colour};font-size:1.3em'>{mark} of 100</b> {html.escape(title)}"
        "<table style='margin:.6em 0'><thead><tr><th>what</th><th>points</th><th>why</th></tr></thead>"
        f"<tbody>{rows}</tbody></table>{said}{pace}{picture}</div>"
    )


def _time(seconds: float) -> str:
    if not seconds > 0:
        return "–"
    return (
        f"{1e6 * seconds:.0f} µs"
        if seconds < 1e-3
        else f"{1e3 * seconds:.1f} ms"
        if seconds < 1
        else f"{seconds:.1f} s"
    )
