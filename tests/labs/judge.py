"""What the tests of the labs' projects share: a scenario is drawn once, a design runs on it once."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from coursekit.teaching import projects
from coursekit.teaching.judging import attempt


class Judge:
    """Marks designs of a project beside the package's own, without the process that stands around it in a notebook.

    project, reference : the project and the package's own design.   seeds : of its scenarios, one a run.
    """

    def __init__(self, project: projects.Project, reference: Callable[..., Any], seeds: Sequence[int]) -> None:
        self.scenario = cache(lambda seed: project.make(np.random.default_rng(seed)))
        self.project = replace(project, make=lambda rng: self.scenario(rng.bit_generator.seed_seq.entropy))
        self.reference, self.seeds = reference, tuple(seeds)
        self.outcome = cache(lambda design, seed: projects.outcome(attempt(self.project, design, seed)))

    def outcomes(self, design: Callable[..., Any], runs: int | None = None) -> list[projects.Outcome]:
        return [self.outcome(design, seed) for seed in self.seeds[:runs]]

    def __call__(self, design: Callable[..., Any], runs: int | None = None) -> projects.Score:
        return projects.mark(self.project, self.outcomes(design, runs), self.outcomes(self.reference, runs))
