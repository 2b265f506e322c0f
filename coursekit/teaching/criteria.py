"""What a project is judged by: errors against limits, NEES against its band, behaviour.

Each function makes a ``judge`` for a ``Criterion``: it gets the finished runs of the design and of the package on the
same scenarios, and answers with a share of the points and one sentence.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coursekit.gaussian import chi2_band
from coursekit.geometry import Array
from coursekit.teaching.projects import Judgement, Outcome

Judge = Callable[[list[Outcome], list[Outcome]], Judgement]


def small(key: str, *, full: float, none: float, unit: str = "", average: Callable = np.mean) -> Judge:
    """The average of ``values[key]`` over all runs: all points up to ``full``, none from ``none``, linear between."""

    def judge(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
        got, package = (float(average([average(o.values[key]) for o in runs])) for runs in (mine, theirs))
        share = float(np.clip((none - got) / (none - full), 0.0, 1.0))
        return share, f"{got:.3g} {unit}".strip() + f" (the package: {package:.3g}; full points up to {full:g})"

    return judge


def honest(
    key: str,
    dof: int,
    *,
    full: float = 0.85,
    none: float = 0.4,
    what: str = "NEES",
    when: Callable[[int], str] = lambda k: f"step {k + 1}",
) -> Judge:
    """The share of steps at which the NEES, averaged over the runs, lies in its two-sided 95 % band.

    Errors of neighbouring steps are alike, so an honest filter's share scatters around 95 %: ``full`` leaves room.

    when : names the k-th of the judged steps, from 0 on.
    """

    def judge(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
        low, high = chi2_band(dof, runs=len(mine))
        averages, package = (np.mean([o.values[key] for o in runs], axis=0) for runs in (mine, theirs))
        inside = (averages > low) & (averages < high)
        share = float(np.clip((inside.mean() - none) / (full - none), 0.0, 1.0))
        said = (
            f"{100 * inside.mean():.0f} % of the steps in the band {low:.2f} to {high:.2f} "
            f"(the package: {100 * np.mean((package > low) & (package < high)):.0f} %); "
            f"the {what} averages {averages.mean():.3g} (the package: {package.mean():.3g}), {dof} is right"
        )
        return share, said if inside.mean() >= full else f"{said}. {_outside(averages, low, high, when)}"

    return judge


def _outside(averages: Array, low: float, high: float, when: Callable[[int], str]) -> str:
    """On which side of the band more steps lie, how many on each side, and where the first long stretch begins."""
    above, below = averages >= high, averages <= low
    counts = f"{above.sum()} steps above, {below.sum()} below"
    if above.sum() == below.sum():
        return counts
    side, out, verdict = (
        ("above", above, "too sure of itself") if above.sum() > below.sum() else ("below", below, "too modest")
    )
    width = max(len(out) // 10, 1)  # a single step of many may be chance
    stretch = np.convolve(out, np.ones(width), mode="valid") == width
    if not stretch.any():
        return f"{counts}: {verdict}"
    long = f", {width} in a row," if width > 1 else ""
    return f"First {side}{long} at {when(int(np.argmax(stretch)))}; {counts}: {verdict}"


def clean(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The share of runs without a remark."""
    spotless = np.mean([not o.remarks for o in mine])
    with_remarks = f"{100 * (1 - spotless):.0f} % of the runs with remarks, see below"
    return float(spotless), "no remarks" if spotless == 1 else with_remarks
