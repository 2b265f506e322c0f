"""The live half of an explorer: the same controls, with the kernel as the source of their pictures.

A widget holds its scene, and the widgets' own registry holds every widget.  So a cell that is run again closes what
its last run had shown: without that, a lab that is worked with for an hour fills the memory with figures.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import anywidget
import traitlets
from IPython import get_ipython

from coursekit.teaching.explore.painting import LIVE_DPI, Facts, Picture, Words, png
from coursekit.teaching.explore.shell import part, shell
from coursekit.teaching.explore.sliders import Slider, Values, start


class LiveExplorer(anywidget.AnyWidget):
    """Controls around a picture that follows them; each question from the page gets one answer, in one message."""

    _esm = f"const explorer = {part('explorer.js')};\n{part('live.js')}"
    _css = part("explorer.css")
    shell = traitlets.Unicode().tag(sync=True)

    def __init__(
        self, sliders: Mapping[str, Slider], picture: Picture, alt: Words, facts: Facts, name: str = ""
    ) -> None:
        self._sliders, self._picture, self._alt, self._facts = sliders, picture, alt, facts
        # A picture is a function of the values, and who drags a slider comes by the same ones again and again.
        self._drawn = lru_cache(maxsize=64)(self._draw)
        first = start(sliders)
        frame, self.words = picture(first, LIVE_DPI), alt(first)
        height, width = frame.shape[:2]
        self.still = "data:image/png;base64," + base64.b64encode(png(frame)).decode()
        html = shell(sliders, {}, (self.still, self.words, width, height), width, name) + "</div>"
        super().__init__(shell=html)
        self.on_msg(lambda _, question, __: self._reply(question))

    def answer(self, positions: list[int]) -> tuple[dict[str, Any], list[bytes]]:
        """The words and the picture at some positions of the controls; an error in words, and no picture."""
        try:
            picture, said = self._drawn(tuple(positions))
            return said, [picture]
        except Exception as problem:  # shown where the reader looks; a widget's callback would bury it in a log
            return {"error": f"{type(problem).__name__}: {problem}"}, []

    def _draw(self, positions: tuple[int, ...]) -> tuple[bytes, dict[str, Any]]:
        values: Values = {name: s.values[i] for (name, s), i in zip(self._sliders.items(), positions, strict=True)}
        picture = png(self._picture(values, LIVE_DPI))
        return picture, {"alt": self._alt(values), "facts": self._facts(values)}

    def _reply(self, question: dict[str, Any]) -> None:
        said, pictures = self.answer(question["at"])
        self.send(said | {"view": question["view"]}, pictures)

    def close(self) -> None:
        """Give everything back: the page's half, the layout's model, the scene."""
        self.layout.close()
        self._picture = self._alt = self._facts = None  # type: ignore[assignment]
        self._drawn.cache_clear()
        super().close()


_shown: dict[str, tuple[str, list[Any]]] = {}
"""Cell → the run that showed, and the explorers that it showed."""


def remember(explorer: Any) -> None:
    """Note that the running cell shows an explorer, and release those that only its earlier run had shown."""
    shell = get_ipython()
    request = shell.get_parent() if hasattr(shell, "get_parent") else {}
    cell, run = request.get("metadata", {}).get("cellId"), request.get("header", {}).get("msg_id", "")
    if cell is None:  # a console, or a front end that does not say which cell it runs
        return
    before, old = _shown.get(cell, ("", []))
    _shown[cell] = (run, [*old, explorer] if before == run else [explorer])
    for gone in old if before != run else []:
        if not any(gone is e for _, shown in _shown.values() for e in shown):
            _forget(shell, gone)
            gone.close()


def _forget(shell: Any, explorer: Any) -> None:
    """Take an explorer out of IPython's history of results (Out, _5, _), unless a variable has it too."""
    names = [name for name, value in shell.user_ns.items() if value is explorer]
    if names and all(name.startswith("_") for name in names):
        shell.del_var(names[0], by_name=False)
