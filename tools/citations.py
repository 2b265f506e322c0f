"""Citations in words, for editors that know no bibliography: {cite}`thrun2005` → (Thrun, Burgard & Fox, 2005)."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

from pybtex.database import BibliographyData, parse_file
from pybtex.plugin import find_plugin
from pybtex.richtext import Text

REFERENCES = Path(__file__).resolve().parents[1] / "book"
ROLE = re.compile(r"\{cite(?P<form>:\w+)?\}`(?P<keys>[^`]+)`")
HEADING = "## Sources"


def bibliography(files: list[Path]) -> BibliographyData:
    """All entries of all files.  Raises ValueError when two files give one key to two sources."""
    merged = BibliographyData()
    for path in files:
        for name, entry in parse_file(path, "bibtex").entries.items():
            if name not in merged.entries:
                merged.add_entry(name, entry)
            elif merged.entries[name].fields.get("title") != entry.fields.get("title"):
                raise ValueError(f"{path.name}: the key {name!r} already names another source")
    return merged


def files() -> list[Path]:
    """The course's shared sources, and each lab's own."""
    return [REFERENCES / "references.bib", *sorted((REFERENCES / "references").glob("*.bib"))]


@cache
def _entries() -> BibliographyData:
    return bibliography(files())


def _entry(key: str):
    if key not in _entries().entries:
        raise ValueError(f"no source has the key {key!r}")
    return _entries().entries[key]


def _authors(key: str, last: str) -> str:
    """Family names: all of up to three, the first of more."""
    people = _entry(key).persons.get("author") or _entry(key).persons.get("editor") or []
    names = [str(Text.from_latex(" ".join([*p.prelast_names, *p.last_names]))) for p in people]
    if not names:
        return str(Text.from_latex(_entry(key).fields["title"]))
    if len(names) > 3:
        return f"{names[0]} et al."
    return f" {last} ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def spell_out(text: str, cited: list[str]) -> str:
    """A text with its citations in words; ``cited`` gains the keys that it does not yet hold.

    Raises ValueError for a key without an entry, and for a form other than {cite} and {cite:t}.
    """

    def words(role: re.Match[str]) -> str:
        keys = [key.strip() for key in role["keys"].split(",")]
        cited.extend(key for key in dict.fromkeys(keys) if key not in cited)
        if role["form"] == ":t":
            return ", ".join(f"{_authors(key, 'and')} ({_entry(key).fields['year']})" for key in keys)
        if role["form"] in (None, ":p"):
            return "(" + "; ".join(f"{_authors(key, '&')}, {_entry(key).fields['year']}" for key in keys) + ")"
        raise ValueError(f"expected {{cite}}, {{cite:p}} or {{cite:t}}, got {role[0]}")

    return ROLE.sub(words, text)


@cache
def _format() -> tuple[Any, Any]:
    """The style and the language of the list; to find them, pybtex reads the metadata of all that is installed."""
    return find_plugin("pybtex.style.formatting", "plain")(), find_plugin("pybtex.backends", "markdown")()


def listed(keys: list[str]) -> str:
    """A last cell: the sources in full, in the order of their authors."""
    style, markdown = _format()
    texts = [" ".join(entry.text.render(markdown).split()) for entry in style.format_entries(map(_entry, keys))]
    # The backend escapes every full stop and bracket; none of them means anything within a line.
    return "\n".join([HEADING, "", *("- " + re.sub(r"\\([.()-])", r"\1", text) for text in texts)])
