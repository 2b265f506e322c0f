"""Scores: a design runs in a process of its own, and whatever it does there ends as a card."""

import os
import time
from dataclasses import replace

import numpy as np
import pytest
import tqdm.auto

from coursekit.labs.lab04.project import PROJECT, Reference
from coursekit.teaching import projects


def loops(mean, cov):
    while True:
        pass


def test_a_design_that_loops_for_ever_ends_the_run_and_not_the_notebook(monkeypatch):
    monkeypatch.setattr(projects, "find", lambda name: replace(PROJECT, patience=0.5))
    began = time.monotonic()
    score = projects.score("lab04", loops, seed=1, runs=3)
    assert score.mark == 0 and "endless loop" in repr(score) and time.monotonic() - began < 60


def test_a_design_that_ends_its_process_or_prints_a_flood_leaves_the_notebook_alone(capfd):
    assert "ended the process" in repr(projects.score("lab04", lambda mean, cov: os._exit(3), seed=1, runs=2))

    def chatters(mean, cov):
        print("x" * 1_000_000)
        os.write(2, b"y" * 1_000_000)
        return Reference(mean, cov)

    assert projects.score("lab04", chatters, seed=1, runs=1).outcomes[0].values
    assert "x" * 100 not in capfd.readouterr().out


def test_the_same_seed_gives_the_same_mark_from_another_process():
    first, second = (projects.score("lab04", Reference, seed=5, runs=2) for _ in range(2))
    assert first.mark == second.mark and first.lines == second.lines
    assert "of 100" in first._repr_html_() and "data:image/png" in first._repr_html_()


def test_what_is_no_design_and_what_is_no_project_get_a_sentence():
    with pytest.raises(TypeError, match="give MyFilter, not MyFilter"):
        projects.score("lab04", Reference(np.zeros(3), np.eye(3)))
    with pytest.raises(ValueError, match="no project named 'lab99'"):
        projects.score("lab99", Reference)
    with pytest.raises(ValueError, match="runs: expected at least 1"):
        projects.score("lab04", Reference, runs=0)


def test_the_bar_counts_the_runs_that_were_asked_for(monkeypatch):
    bars = []

    class Bar(tqdm.auto.tqdm):
        def __init__(self, **options):
            super().__init__(**options)
            bars.append(self)

    monkeypatch.setattr(tqdm.auto, "tqdm", Bar)
    projects.score("lab04", Reference, seed=1, runs=2)
    assert [(bar.total, bar.n) for bar in bars] == [(2, 2), (2, 2)]
    assert bars[0].desc.startswith(PROJECT.title) and "the package" in bars[1].desc
