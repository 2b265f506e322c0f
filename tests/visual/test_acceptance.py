"""The full-size evidence for Lab 8: some ten minutes, so only when asked for (``make test-slow``)."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_fifty_dives_of_two_hundred_frames_hold_every_claim():
    """The claims carry their own numbers; the dives are seeded, so this cannot fail by chance."""
    command = [sys.executable, str(ROOT / "benchmarks" / "visual.py"), "--acceptance", "50"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "FAILS" not in done.stdout and done.stdout.count("holds") == 7
