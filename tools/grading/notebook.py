"""A submission read as data: which code answers which exercise, and what that code needs.

Nothing is run here.  Of a notebook's cells only those statements are taken that the answer needs: its definition, the
helpers, imports and constants that it names, what those name in turn, and whatever changes them.  A cell that loops for
ever or prints without an end is left out unless the answer hangs on it.
"""

from __future__ import annotations

import ast
import json
import re
import symtable
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

LARGEST = 50_000_000  # bytes of a notebook; a book of pictures has a tenth
TASK = re.compile(r"lab\d\d(\.\w+)?")


@dataclass(frozen=True)
class Task:
    """An exercise or a project of a lab.  target : the name that the lab gives to the answer.  runs : of a project."""

    name: str
    kind: str
    target: str
    runs: int = 0

    @property
    def lab(self) -> str:
        """As in "lab04"."""
        return self.name[:5]

    @property
    def key(self) -> str:
        """As in "lab04.innovation" and "lab04.project"."""
        return self.name if self.kind == "exercise" else f"{self.name}.project"


@dataclass
class Statement:
    """A top-level statement of a cell.  binds, changes, uses : names.  where : "code cell 7"."""

    source: str
    where: str
    binds: set[str]
    changes: set[str]
    uses: set[str]
    node: ast.stmt

    @property
    def imports(self) -> bool:
        """Whether it is an import."""
        return isinstance(self.node, (ast.Import, ast.ImportFrom))


@dataclass
class Notebook:
    """A notebook's code.  trouble : what could not be read, in sentences."""

    statements: list[Statement] = field(default_factory=list)
    trouble: list[str] = field(default_factory=list)

    def asked(self) -> dict[str, tuple[str, str, int]]:
        """Task → (kind, name of the answer, runs), from the cells that check."""
        found = {}
        for statement in self.statements:
            for call in ast.walk(statement.node):
                if isinstance(call, ast.Call) and len(call.args) >= 2:
                    verb = getattr(call.func, "attr", getattr(call.func, "id", ""))
                    name, answer = call.args[:2]
                    known = isinstance(name, ast.Constant) and TASK.fullmatch(str(name.value))
                    if verb in ("check", "score") and known and isinstance(answer, ast.Name):
                        runs = next((k.value for k in call.keywords if k.arg == "runs"), None)
                        runs = runs.value if isinstance(runs, ast.Constant) and isinstance(runs.value, int) else 3
                        kind = "exercise" if verb == "check" else "project"
                        found[name.value] = (kind, answer.id, runs)
        return found

    def answer(self, task: Task) -> str | None:
        """The name under which a task is answered: the lab's own, or else what the notebook's own check names."""
        bound = set().union(*(s.binds for s in self.statements)) if self.statements else set()
        _, own, _ = self.asked().get(task.name, ("", "", 0))
        return next((name for name in (task.target, own) if name in bound), None)

    def needed(self, target: str, given: Notebook) -> list[tuple[str, str]]:
        """The statements that ``target`` needs, as (where, source), in their order.

        given : the lab as it was handed out.  Its imports stand first, for a notebook whose import cell was deleted.
        """
        every = [s for s in given.statements if s.imports] + self.statements
        imported = set().union(*(s.binds for s in every if s.imports))
        # A call such as np.set_printoptions(…) changes no module; table.append(…) does change the table.
        binds = [s.binds | (s.changes - imported) for s in every]
        wanted, taken = {target, "*"}, set()
        while more := {i for i, bound in enumerate(binds) if i not in taken and bound & wanted}:
            taken |= more
            wanted |= set().union(*(every[i].uses for i in more))
        return [(every[i].where, every[i].source) for i in sorted(taken)]


def read(path: Path) -> Notebook:
    """A notebook from a file that may be anything; what cannot be read is a sentence in ``trouble``."""
    try:
        if path.stat().st_size > LARGEST:
            return Notebook(trouble=[f"The file is larger than {LARGEST // 1_000_000} MB. Clear all outputs and save."])
        cells = json.loads(path.read_text(encoding="utf-8-sig"))["cells"]
        sources = [_text(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        return Notebook(trouble=[f"This is no notebook that can be read ({type(error).__name__})."])
    return parse(sources)


def parse(sources: list[str]) -> Notebook:
    """The code of some cells."""
    notebook = Notebook()
    for number, source in enumerate(sources, 1):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SyntaxWarning)
                tree, plain = _tree(source)
                for node in tree.body:
                    notebook.statements += _statements(node, plain, f"code cell {number}")
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            line = f", line {error.lineno}" if isinstance(error, SyntaxError) and error.lineno else ""
            said = error.msg if isinstance(error, SyntaxError) else type(error).__name__
            notebook.trouble.append(f"Code cell {number}{line} is not Python: {said}.")
    return notebook


def _text(source: Any) -> str:
    return "".join(source) if isinstance(source, list) else str(source)


def _tree(source: str) -> tuple[ast.Module, str]:
    """A cell's tree, and its text; IPython's own lines become comments, and a cell in another language is empty."""
    if re.match(r"\s*%%(?!time|capture)", source):
        return ast.Module([], []), ""
    try:
        return ast.parse(source), source
    except SyntaxError:
        plain = re.sub(r"^([ \t]*)(?=[%!?]|[^#\n]*\?[ \t]*$)", r"\1pass  # ", source, flags=re.MULTILINE)
        return ast.parse(plain), plain


def _statements(node: ast.stmt, source: str, where: str) -> list[Statement]:
    """A statement; of an import, one for each name, so that a missing library costs only what needs it."""
    if isinstance(node, ast.Import):
        ones: list[ast.stmt] = [ast.Import([alias]) for alias in node.names]
    elif isinstance(node, ast.ImportFrom):
        ones = [ast.ImportFrom(node.module, [alias], node.level) for alias in node.names]
    else:
        lines = source.split("\n")
        first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", []))])
        # Blank lines before it keep the numbers of the lines, and so the lines that a hint quotes.
        text = "\n" * (first - 1) + "\n".join(lines[first - 1 : node.end_lineno])
        alone = len(ast.parse(text).body) == 1  # not so for the second half of a = 1; b = 2
        text = text if alone else ast.unparse(node)
        return [Statement(text, where, *_bound(node), _used(text), node)]
    names = [alias.asname or alias.name.split(".")[0] for alias in node.names]
    return [
        Statement(ast.unparse(one), where, {name}, set(), set(), one) for one, name in zip(ones, names, strict=True)
    ]


def _bound(node: ast.stmt) -> tuple[set[str], set[str]]:
    """Names that a statement binds (``x = …``, ``x.a = …``, ``x[0] = …``), and those whose methods it calls."""
    names, changed = set(), set()
    pending: list[ast.AST] = [node]
    while pending:
        part = pending.pop()
        if isinstance(part, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            names.add(part.name)
            names |= {n for inner in ast.walk(part) if isinstance(inner, ast.Global) for n in inner.names}
            continue
        if isinstance(part, (ast.Name, ast.Attribute, ast.Subscript)) and isinstance(part.ctx, (ast.Store, ast.Del)):
            names |= _root(part)
        if isinstance(part, ast.Expr) and isinstance(part.value, ast.Call):
            call = part.value
            changed |= _root(call.func) if isinstance(call.func, ast.Attribute) else set()
            names |= (
                _root(call.args[0]) if call.args and getattr(call.func, "id", "") in ("setattr", "delattr") else set()
            )
        pending += [] if isinstance(part, ast.Lambda) else list(ast.iter_child_nodes(part))
    return names, changed


def _root(part: ast.AST) -> set[str]:
    while isinstance(part, (ast.Attribute, ast.Subscript)):
        part = part.value
    return {part.id} if isinstance(part, ast.Name) else set()


def _used(text: str) -> set[str]:
    """Names that a statement takes from the notebook: not a function's own variables."""
    top = symtable.symtable(text, "cell", "exec")
    names = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_referenced()}
    pending = list(top.get_children())
    while pending:
        table = pending.pop()
        names |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global()}
        pending += table.get_children()
    return names
