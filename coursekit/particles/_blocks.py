"""A large cloud in blocks that fit a processor's cache: for speed alone, the numbers are the same."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

BLOCK = 8192  # particles at a time: a dozen temporaries of 64 kB fit a second-level cache, a cloud of 10⁵ does not


def blocks(n: int) -> list[slice]:
    """Slices of about ``BLOCK`` that make up 0 … n."""
    edges = np.linspace(0, n, max(1, round(n / BLOCK)) + 1).astype(int).tolist()
    return [slice(start, end) for start, end in pairwise(edges)]
