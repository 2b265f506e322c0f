"""Run the labs for the book: in parallel, each only when something it depends on has changed.

A run is kept under a key made of the lab's code, the package, the data and the versions of everything installed.
Prose and tags are not in the key: mending a sentence does not run a lab again.
"""

from __future__ import annotations

import hashlib
import os
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from tqdm import tqdm
from traitlets.config import Config

from coursekit.recordings import datasets

ROOT = Path(__file__).resolve().parents[1]
WIDGET = "application/vnd.jupyter.widget-view+json"
TIMEOUT = 300  # seconds for one cell; the slowest draws some 150 frames
# One thread a kernel, since the kernels share the cores; sliders in their published form.
ENVIRONMENT = {"COURSEKIT_STATIC": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}


class LabFailed(Exception):
    """A lab that does not run to its end; the message says which, where, and why."""


def read(path: Path) -> nbformat.NotebookNode:
    """A notebook from its file."""
    return nbformat.read(path, as_version=4)


def code(notebook: nbformat.NotebookNode) -> list[str]:
    """The sources of the code cells, in order."""
    return [cell.source for cell in notebook.cells if cell.cell_type == "code"]


def recordings() -> tuple[list[Path], list[str]]:
    """The files of other people's recordings that are here, and for each recording that is not, why."""
    here, missing = [], []
    for name, origin in datasets.ORIGINS.items():
        try:
            here += [datasets.locate(name) / file for file in sorted(origin.sha256)]
        except datasets.DatasetUnavailable as error:
            missing.append(str(error))
    return here, missing


def surroundings(root: Path = ROOT, also: Iterable[Path] = ()) -> str:
    """A digest of all that a lab's pictures depend on beside its own code; ``also`` are files from elsewhere."""
    digest = hashlib.sha256(sys.version.encode())
    own = [root / "requirements.lock", *sorted((root / "coursekit").rglob("*")), *sorted((root / "data").rglob("*"))]
    for path in own:
        if path.is_file() and "__pycache__" not in path.parts:
            digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    for path in also:
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def key(notebook: nbformat.NotebookNode, around: str) -> str:
    """The name under which a run of this notebook is kept."""
    return hashlib.sha256("\0".join([around, *code(notebook)]).encode()).hexdigest()[:16]


def run(notebook: nbformat.NotebookNode, path: Path, progress: tqdm | None = None) -> nbformat.NotebookNode:
    """A copy of the notebook with its outputs.  Raises ``LabFailed`` at the first error, with the lab's name."""
    executed = nbformat.from_dict(notebook)
    client = NotebookClient(
        executed,
        timeout=TIMEOUT,
        record_timing=False,  # one commit gives one page
        kernel_name="python3",
        config=Config(KernelManager={"transport_encryption": "auto"}),
        resources={"metadata": {"path": str(path.parent)}},
        on_cell_executed=lambda **_: progress.update() if progress is not None else None,
    )
    try:
        client.execute(env=os.environ | ENVIRONMENT)
    except (CellExecutionError, TimeoutError, RuntimeError) as error:
        raise LabFailed(f"{path.name} does not run to its end\n{error}") from error
    return without_widgets(executed)


def without_widgets(executed: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """The notebook without its kernel's widgets, such as bars: no page shows them, and each run names them anew."""
    executed.metadata.pop("widgets", None)
    for cell in executed.cells:
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if WIDGET not in output.get("data", {})]
    return executed


def with_outputs(notebook: nbformat.NotebookNode, executed: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """The notebook as it is written now, with the outputs of a run of the same code."""
    merged = nbformat.from_dict(notebook)
    cells = [cell for cell in merged.cells if cell.cell_type == "code"]
    ran = [cell for cell in executed.cells if cell.cell_type == "code"]
    for cell, done in zip(cells, ran, strict=True):
        cell.outputs, cell.execution_count = done.outputs, done.execution_count
    return merged


def execute(
    paths: Iterable[Path], jobs: int, cache: Path, root: Path = ROOT, also: Iterable[Path] = ()
) -> dict[Path, nbformat.NotebookNode]:
    """Every notebook with its outputs: from the cache where nothing changed, else run, ``jobs`` at a time.

    Raises ``LabFailed`` with every lab that failed; the runs that succeeded are kept.
    """
    cache.mkdir(parents=True, exist_ok=True)
    around = surroundings(root, also)
    labs = {path: read(path) for path in paths}
    kept = {path: cache / f"{path.stem}-{key(lab, around)}.ipynb" for path, lab in labs.items()}
    stale = [path for path in labs if not kept[path].exists()]
    print(f"labs: {len(labs) - len(stale)} unchanged, {len(stale)} to run, {jobs} at a time", flush=True)
    failures: list[str] = []

    def work(path: Path) -> None:
        began = time.perf_counter()
        try:
            executed = run(labs[path], path, progress)
        except LabFailed as failed:
            failures.append(str(failed))
            return
        partial = kept[path].with_suffix(f".{os.getpid()}")
        nbformat.write(executed, partial)
        partial.replace(kept[path])  # a run that is cut off leaves nothing half written
        for old in set(cache.glob(f"{path.stem}-*.ipynb")) - {kept[path]}:
            old.unlink(missing_ok=True)
        progress.write(f"  {path.stem}: {time.perf_counter() - began:.1f} s")

    if stale:
        import matplotlib.font_manager  # noqa: F401  (builds its cache here, not as a warning inside a lab)

        cells = sum(len(code(labs[path])) for path in stale)
        with (
            tqdm(total=cells, unit="cell", desc="running the labs", disable=None) as progress,
            ThreadPoolExecutor(jobs) as pool,
        ):
            list(pool.map(work, stale))
    if failures:
        raise LabFailed("\n\n".join(failures))
    return {path: with_outputs(lab, read(kept[path])) for path, lab in labs.items()}
