"""The gallery of failures: a page for each lab, a picture for each failure, drawn once and kept."""

from __future__ import annotations

import hashlib
import inspect
import textwrap
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from coursekit.teaching import failures
from coursekit.teaching.failures import Failure
from reference import pictures
from reference.api import lab_number
from reference.formulas import title

HERE = Path(__file__).parent


def key(package: Path) -> str:
    """A digest of all that the pictures depend on: the package, and the code that draws."""
    digest = hashlib.sha256()
    for path in [*sorted(package.rglob("*.py")), *sorted((HERE / "pictures").glob("*.py"))]:
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def drawn(name: str, cache: Path, digest: str) -> bytes:
    """A failure's picture as WebP, from the cache when nothing changed."""
    kept = cache / f"{name}-{digest}.webp"
    if not kept.exists():
        draw, _ = pictures.of(name)
        draw().savefig(png := BytesIO(), dpi=144)
        cache.mkdir(parents=True, exist_ok=True)
        for old in cache.glob(f"{name}-*.webp"):
            old.unlink()
        Image.open(png).convert("RGB").save(kept, "WEBP", lossless=True, method=1)
    return kept.read_bytes()


def words(name: str) -> str:
    """ "lab04.hard_gate" → "Hard gate"."""
    return name.partition(".")[2].replace("_", " ").capitalize()


def _said(thing: Any) -> str:
    first = (inspect.getdoc(thing) or "").split("\n\n")[0]
    return " ".join(first.split())


def _code(thing: Any) -> str:
    return textwrap.dedent(inspect.getsource(thing)).rstrip()


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:].rstrip(".") + "."


def _letters(text: str) -> str:
    """Plain text in Markdown: stars and underscores are letters."""
    return "".join("\\" + c if c in "*_[]$<" else c for c in text)


def entry(failure: Failure) -> str:
    """One failure's section."""
    name, (_, caption) = failure.name, pictures.of(failure.name)
    return f"""(failure-{name.replace(".", "-")})=
## {words(name)}

**What you see.** {_letters(failure.lesson)}

```{{figure}} {name}.webp
:name: fig-{name.replace(".", "-").replace("_", "-")}
:alt: {caption}

{_letters(caption)}
```

**Who made it.** {_letters(_sentence(failure.source))}

**What catches it.** The check `{failure.check.__name__}`: {_letters(_said(failure.check))}

:::{{dropdown}} The mistake, the sound version and the check, in code
```python
{_code(failure.wrong)}


# The sound version: {getattr(failure.right, "__module__", "")}.{failure.right.__name__}


{_code(failure.check)}
```
:::
"""


def pages(labs: list[Path], cache: Path) -> dict[str, str | bytes]:
    """The pages ``failures/labNN.md``, their pictures, and the page that lists them."""
    digest = key(HERE.parents[1] / "coursekit")
    by_lab = {f"lab{path.stem[:2]}": path for path in reversed(labs)}
    made: dict[str, str | bytes] = {}
    shown: dict[str, list[Failure]] = {}
    for name, failure in failures.gallery().items():
        if name.split(".")[0] in by_lab:
            shown.setdefault(name.split(".")[0], []).append(failure)
    rows = []
    for lab, mistakes in shown.items():
        path = by_lab[lab]
        number = lab_number(path)
        head = (
            f"# Failures of Lab {number}\n\nFrom [Lab {number}: {title(path)}](../notebooks/{path.name}). "
            "In every picture the mistake is orange, the sound version blue, the truth black.\n"
        )
        made[f"failures/{lab}.md"] = "\n".join([head, *map(entry, mistakes)])
        for failure in mistakes:
            made[f"failures/{failure.name}.webp"] = drawn(failure.name, cache, digest)
            link = f"[{words(failure.name)}]({lab}.md#failure-{failure.name.replace('.', '-')})"
            rows.append(f"| {lab_number(path)} | {link} | {_letters(failure.lesson)} | `{failure.check.__name__}` |")
    toctree = "\n".join(shown)
    made["failures/index.md"] = (
        f"# The gallery of failures\n\n{ABOUT}\n\n| lab | failure | what you see | caught by |\n"
        f"| --- | --- | --- | --- |\n" + "\n".join(rows) + f"\n\n```{{toctree}}\n:hidden:\n\n{toctree}\n```\n"
    )
    return made


ABOUT = """Each of these mistakes was really made, in a report, in a published program or in a widely copied recipe.
Each runs without an error message, and each is caught by a check that has a name. The test suite runs every check on
the mistake and on the sound version beside it."""
