"""What the reader handles, the same in the book and live: labelled controls around a picture, as HTML."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from coursekit.teaching.explore.sliders import Slider


def part(name: str) -> str:
    """One of the explorer's own files: its script in parts, or its style."""
    return files("coursekit.teaching.explore").joinpath(name).read_text(encoding="utf-8").strip()


def shell(
    sliders: Mapping[str, Slider], data: dict[str, Any], picture: tuple[str, str, int, int], width: int, name: str = ""
) -> str:
    """All of an explorer but its script: the picture (address, words, width, height), the controls, the data.

    ``width`` is that of the picture on the screen [px], where there is room for it.  Nothing in here has an id, so
    that one explorer may stand twice in a page; the controls are hidden until a script has made them work.
    """
    address, words, *size = picture
    labels = [s.label or key for key, s in sliders.items()]
    said = html.escape("Interactive figure: " + ", ".join(labels), quote=True)
    data = data | {"width": width, "sizes": [len(s.values) for s in sliders.values()]}
    data |= {"texts": [[s.text(v) for v in s.values] for s in sliders.values()]}
    data |= {"names": list(sliders), "values": [s.values for s in sliders.values()]}
    # "<" is escaped so that no text can end the script element early.
    payload = json.dumps(data, ensure_ascii=False).replace("<", "\\u003c")
    return (
        f'<div class="explorer" role="group" aria-label="{said}"{f" data-explorer={json.dumps(name)}" if name else ""}'
        f' style="max-width:{width}px;--explorer-width:{width}px"><div class="explorer-body">'
        f'<div class="explorer-picture"><img src="{address}" alt="{html.escape(words, quote=True)}"'
        f' width="{size[0]}" height="{size[1]}" decoding="sync"></div>'
        '<p class="explorer-problem" role="alert"></p><form class="explorer-controls" autocomplete="on" hidden>'
        + "".join(_control(key, slider) for key, slider in sliders.items())
        + '<div class="explorer-tools"><button type="button" class="explorer-surprise" hidden>Surprise me</button>'
        '<button type="button" class="explorer-enlarge" hidden>Enlarge the picture</button></div></form>'
        '<p class="explorer-words" aria-live="polite"></p>'
        f"<noscript><p>This picture is one of {_count(sliders)}; to see the others, allow scripts.</p></noscript></div>"
        f'<script type="application/json" class="explorer-data">{payload}</script>'
    )


def _count(sliders: Mapping[str, Slider]) -> int:
    total = 1
    for slider in sliders.values():
        total *= len(slider.values)
    return total


def _control(name: str, slider: Slider) -> str:
    label, first = html.escape(slider.label or name, quote=True), slider.values.index(slider.start)
    text = html.escape(slider.text(slider.start), quote=True)
    if slider.is_choice:
        buttons = "".join(
            f'<label><input type="radio" name="{name}" value="{i}"{" checked" if i == first else ""}>'
            f"<span>{html.escape(slider.text(v))}</span></label>"
            for i, v in enumerate(slider.values)
        )
        return f'<fieldset class="explorer-control" data-name="{name}"><legend>{label}</legend>{buttons}</fieldset>'
    play = f'<button type="button" class="explorer-play" data-label="{label}"></button>' if slider.play else ""
    return (
        f'<div class="explorer-control" data-name="{name}">{play}<label><span class="explorer-name">{label}</span>'
        f'<input type="range" name="{name}" min="0" max="{len(slider.values) - 1}" step="1" value="{first}"'
        f' aria-valuetext="{text}"></label><output>{text}</output></div>'
    )
