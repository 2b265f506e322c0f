"""What an import costs, beside what it stands on: each in a fresh process, in turn, the processor's time of the import.

python benchmarks/imports.py [rounds]
"""

from __future__ import annotations

import statistics
import subprocess
import sys

BASE = "import scipy.linalg"
IMPORTS = [
    BASE,
    "from coursekit import ekf",
    "from coursekit import slam",
    "from coursekit import particles",
    "from coursekit import icp",
    "import scipy.stats",
]


def seconds(code: str) -> float:
    """Processor time of ``code`` in a process of its own."""
    timed = f"import time; began = time.process_time(); {code}; print(time.process_time() - began)"
    return float(subprocess.run([sys.executable, "-c", timed], check=True, capture_output=True, text=True).stdout)


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    times = [[seconds(code) for code in IMPORTS] for _ in range(rounds)]
    base = [one[0] for one in times]
    print(f"median of {rounds} rounds                 seconds   × {BASE.split()[1]}")
    for code, own in zip(IMPORTS, zip(*times, strict=True), strict=True):
        ratio = statistics.median(a / b for a, b in zip(own, base, strict=True))
        print(f"{code:34} {statistics.median(own):9.3f} {ratio:9.2f}")


if __name__ == "__main__":
    main()
