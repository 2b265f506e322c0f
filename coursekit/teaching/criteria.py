"""What a project is judged by: errors against limits, NEES against its band, behaviour.

Each function makes a ``judge`` for a ``Criterion``: it gets the finished runs of the design and of the package on the
same scenarios, and answers with a share of the points and one sentence.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coursekit.gaussian import chi2_band
from coursekit.teaching.projects import Judgement, Outcome

Judge = Callable[[list[Outcome], list[Outcome]], Judgement]


def small(key: str, *, full: float, none: float, unit: str = "", average: Callable = np.mean) -> Judge:
    """The average of ``values[key]`` over all runs: all points up to ``full``, none from ``none``, linear between."""

    def judge(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
        got, package = (float(average([average(o.values[key]) for o in runs])) for runs in (mine, theirs))
        share = float(np.clip((none - got) / (none - full), 0.0, 1.0))
        return share, f"{got:.3g} {unit}".strip() + f" (the package: {package:.3g}; full points up to {full:g})"

    return judge


def honest(key: str, dof: int, *, full: float = 0.85, none: float = 0.4, what: str = "NEES") -> Judge:
    """The share of steps at which the NEES, averaged over the runs, lies in its two-sided 95 % band.

    Errors of neighbouring steps are alike, so an honest filter's share scatters around 95 %: ``full`` leaves room.
    """

    def judge(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
        low, high = chi2_band(dof, runs=len(mine))
        averages = np.mean([o.values[key] for o in mine], axis=0)
        inside = (averages > low) & (averages < high)
        share = float(np.clip((inside.mean() - none) / (full - none), 0.0, 1.0))
        said = (
            f"{100 * inside.mean():.0f} % of the steps in the band {low:.2f} to {high:.2f}; "
            f"the {what} averages {averages.mean():.3g}, {dof} is right"
        )
        if inside.mean() < full:
            # the first step after which the average stays out for a tenth of the run
            width = max(len(inside) // 10, 1)
            out = np.convolve(~inside, np.ones(width), mode="valid") == width
            if out.any():
                step = int(np.argmax(out))
                side = "above: too sure of itself" if averages[step] > high else "below: too modest"
                said += f". From step {step + 1} on it lies {side}"
        return share, said

    return judge


def clean(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The share of runs without a remark."""
    spotless = np.mean([not o.remarks for o in mine])
    with_remarks = f"{100 * (1 - spotless):.0f} % of the runs with remarks, see below"
    return float(spotless), "no remarks" if spotless == 1 else with_remarks
