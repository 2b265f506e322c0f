"""Do the numbers hold on other processors?  The numerical tests, once for each kind of arithmetic that this one can do.

    python tools/portable.py            # every numerical test, ten minutes on two cores
    python tools/portable.py --short    # the tests that rounding reaches most easily, under a minute

OpenBLAS, which NumPy and SciPy each bring along, sums in another order on each family of processors, and NumPy's own
loops do so with and without AVX-512 and AVX2.  The last bits of a result differ, and nothing else may.  Each row of
the table is a process of its own with ``OPENBLAS_CORETYPE`` or ``NPY_DISABLE_CPU_FEATURES`` set; before it runs, the
libraries are asked what they took.  What this processor cannot run is left out, with the reason.

Leaves with an error when a test fails anywhere, and when nothing could be run.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

NUMERICAL = (
    "tests/test_geometry.py", "tests/test_gaussian.py", "tests/models", "tests/test_pinhole.py", "tests/noise",
    "tests/test_ekf.py", "tests/slam", "tests/icp", "tests/test_graph.py", "tests/particles", "tests/visual",
    "tests/recordings", "tests/labs/lab09",
)  # fmt: skip
# Singular clouds, ties, closed forms and covariances: where a branch would hang on a last bit if one did.
SHORT = (
    "tests/test_gaussian.py", "tests/icp/test_fit.py", "tests/test_graph.py", "tests/icp/test_pairing.py",
    "tests/icp/test_surface.py",
    "tests/icp/test_registration.py::test_a_small_motion_of_a_cloud_is_found_exactly",
    "tests/icp/test_registration.py::test_clouds_that_cannot_hold_an_answer_give_one_that_says_so",
    "tests/icp/test_registration.py::test_a_sheet_is_said_to_slide_both_ways_and_to_turn_whatever_basis_the_solver_returns",
    "tests/icp/test_global_registration.py::test_of_equal_starts_the_first_that_was_tried_is_returned",
    "tests/noise/test_correlation.py::test_a_sequence_that_never_changes_has_no_correlation_however_its_mean_is_rounded",
    "tests/visual/test_calibration.py::test_a_step_is_wild_beyond_four_robust_deviations_and_moves_nothing",
    "tests/visual/test_calibration.py::test_a_recording_without_noise_keeps_every_step_and_a_noise_that_is_positive_definite",
    "tests/visual/test_filtering.py::test_of_two_clusters_that_weigh_the_same_the_first_is_dominant_however_their_sums_are_rounded",
)  # fmt: skip

# Kernel: what NumPy calls the instructions it needs, and the names under which OpenBLAS may report it.
KERNELS = {
    "Haswell": ({"AVX2", "FMA3"}, {"Haswell"}),
    "Zen": ({"AVX2", "FMA3"}, {"Zen", "Haswell"}),  # most builds take one for the other
    "SkylakeX": ({"AVX512F", "AVX512CD", "AVX512_SKX"}, {"SkylakeX"}),
    "Sandybridge": ({"AVX"}, {"Sandybridge"}),
    "Prescott": ({"SSE3"}, {"Prescott", "Katmai"}),  # the same kernel, on 64 bits
}
# Variables that choose instructions, here or in other libraries: a row sets its own and inherits none.
CHOOSING = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU", "NPY_ENABLE_CPU", "NVPL_", "MKL_")

PROBE = """
import ctypes, json, pathlib
import numpy, scipy.linalg
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

cores = {}
for package in (numpy, scipy):
    home = pathlib.Path(package.__file__).parent
    for folder in (home.with_name(home.name + ".libs"), home / ".dylibs"):
        for file in folder.glob("*openblas*") if folder.is_dir() else ():
            library = ctypes.CDLL(str(file))
            for name in ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename",
                         "openblas_get_corename64_", "openblas_get_corename"):
                if function := getattr(library, name, None):
                    function.restype = ctypes.c_char_p
                    cores[package.__name__] = function().decode()
                    break
features = [name for name, there in __cpu_features__.items() if there]
print(json.dumps({"cores": cores, "features": features, "dispatch": [d for d in __cpu_dispatch__ if d in features]}))
"""


@dataclass
class Row:
    """One kind of arithmetic: the variables that ask for it, and what became of it."""

    name: str
    variables: dict[str, str] = field(default_factory=dict)
    left_out: str = ""
    counts: dict[str, int] = field(default_factory=dict)
    broken: list[str] = field(default_factory=list)
    seconds: float = 0.0
    code: int = 0


def environment(variables: dict[str, str]) -> dict[str, str]:
    inherited = {key: value for key, value in os.environ.items() if not key.startswith(CHOOSING)}
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    return inherited | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": path} | variables


def probe(variables: dict[str, str]) -> dict:
    """What OpenBLAS and NumPy take under these variables."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE], env=environment(variables), capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def rows() -> list[Row]:
    """Every kind of arithmetic, with the reason where it cannot be had here."""
    here, found, taken = probe({}), [], {}
    for name, (needed, reported) in KERNELS.items():
        row = Row(name, {"OPENBLAS_CORETYPE": name})
        found.append(row)
        if not here["cores"]:
            row.left_out = "NumPy and SciPy bring no OpenBLAS here"
        elif missing := needed - set(here["features"]):
            row.left_out = f"this processor has no {', '.join(sorted(missing))}"
        else:
            cores = probe(row.variables)["cores"]
            if not set(cores.values()) <= reported:
                row.left_out = f"asked for, but OpenBLAS took {cores}"
            elif (key := str(cores)) in taken:
                row.left_out = f"this OpenBLAS takes its {taken[key]} kernel, which has run"
            else:
                taken[key] = name
    for name, prefixes in (("no AVX-512", ("AVX512", "X86_V4")), ("no AVX2", ("AVX", "X86_V3", "X86_V4", "FMA"))):
        off = [feature for feature in here["dispatch"] if feature.startswith(prefixes)]
        row = Row(f"NumPy, {name}", {"NPY_DISABLE_CPU_FEATURES": " ".join(off)})
        found.append(row)
        if not off:
            row.left_out = "NumPy uses nothing of the kind on this processor"
        elif still := set(off) & set(probe(row.variables)["features"]):
            row.left_out = f"asked for, but NumPy kept {', '.join(sorted(still))}"
    return found


def run(row: Row, tests: tuple[str, ...]) -> Row:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not slow and not browser", *tests]
    start = time.perf_counter()
    done = subprocess.run(command, cwd=ROOT, env=environment(row.variables), capture_output=True, text=True)
    row.seconds, row.code = time.perf_counter() - start, done.returncode
    lines = done.stdout.splitlines()
    row.counts = (
        {word: int(number) for number, word in re.findall(r"(\d+) (passed|failed|error)", lines[-1])} if lines else {}
    )
    row.broken = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    if row.code and not row.broken:
        row.broken = [*lines[-5:], *done.stderr.splitlines()[-5:]] or [f"pytest left with {row.code}"]
    return row


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="only the tests that rounding reaches most easily")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="rows at a time")
    options = parser.parse_args()
    table = rows()
    with ThreadPoolExecutor(options.jobs) as pool:
        ran = list(pool.map(lambda row: run(row, SHORT if options.short else NUMERICAL),
                            [row for row in table if not row.left_out]))  # fmt: skip
    print(f"{'arithmetic':18} {'passed':>7} {'failed':>7} {'time':>7}")
    for row in table:
        if row.left_out:
            print(f"{row.name:18} left out: {row.left_out}")
        else:
            failed = row.counts.get("failed", 0) + row.counts.get("error", 0)
            print(f"{row.name:18} {row.counts.get('passed', 0):7d} {failed:7d} {row.seconds:6.0f}s")
    for row in ran:
        for line in row.broken:
            print(f"{row.name}: {line}")
    if not ran:
        print("Nothing could be run: this machine offers no other arithmetic.")
    return int(not ran or any(row.code for row in ran))


if __name__ == "__main__":
    raise SystemExit(main())
