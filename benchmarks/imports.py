"""What an import costs, beside what it stands on: each in a fresh process, in turn, the processor's time of the import.

python benchmarks/imports.py [--rounds 15] [--json FILE]
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np  # noqa: E402

from benchmarks import results  # noqa: E402

# What is imported, and what it stands on.
IMPORTS = {
    "import coursekit": "import numpy",
    "from coursekit import ekf": "import scipy.linalg",
    "from coursekit import slam": "import scipy.linalg",
    "from coursekit import particles": "import scipy.linalg",
    "from coursekit import icp": "import scipy.spatial",
    "from coursekit import graph": "import scipy.sparse.linalg",
    "from coursekit import visual": "import cv2, scipy.linalg",
    "from coursekit.world.robot import World": "import pymunk, scipy.linalg",
    "import scipy.stats": "import scipy.linalg",
}


def seconds(code: str) -> float:
    """Processor time of ``code`` in a process of its own."""
    timed = f"import time; began = time.process_time(); {code}; print(time.process_time() - began)"
    return float(
        subprocess.run(
            [sys.executable, "-c", timed], check=True, capture_output=True, text=True, cwd=results.ROOT
        ).stdout
    )


def main() -> None:
    options = results.parser(__doc__, rounds=15).parse_args()
    codes = [*IMPORTS, *dict.fromkeys(IMPORTS.values())]
    taken = {code: [] for code in codes}
    for _ in range(options.rounds):
        for code in codes:
            taken[code].append(seconds(code))
    rows = results.Rows("Imports", threads=1)
    print(f"median of {options.rounds} rounds                 seconds   × what it stands on")
    for code, base in IMPORTS.items():
        own, ground = np.array(taken[code]), np.array(taken[base])
        print(f"{code:34} {np.median(own):9.3f} {np.median(own / ground):9.2f} × {base.removeprefix('import ')}")
        if "coursekit" in code:
            top = base.split()[1].strip(",").partition(".")[0]
            distribution = {"cv2": "opencv-python-headless"}.get(top, top)
            rows.add(f"`{code}`", "s", own, ground, (f"`{base}`", results.version(distribution)))
    rows.store(options.json)


if __name__ == "__main__":
    main()
