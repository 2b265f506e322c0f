"""The live half of an explorer: ipywidgets around one picture."""

from __future__ import annotations

import html
from collections.abc import Mapping
from typing import Any

import ipywidgets as w

from coursekit.explore.painting import LIVE_DPI, Picture, Words, png
from coursekit.explore.sliders import Slider, start


def live_widget(sliders: Mapping[str, Slider], picture: Picture, alt: Words) -> w.VBox:
    """Controls above a picture of fixed height that follows them.

    Each event is handled to its end, and while one is being handled the browser keeps only the newest position of
    a slider: the picture never runs after a queue of stale ones.  An error is shown under the picture, which stays.
    """
    controls = {name: _control(name, slider) for name, slider in sliders.items()}
    first = picture(start(sliders), LIVE_DPI)
    image = w.Image(value=png(first), format="png", width=first.shape[1], height=first.shape[0])
    # max-width lets the picture shrink with a narrow window; its height then follows.
    image.layout = w.Layout(max_width="100%", object_fit="contain")
    words, error = w.HTML(), w.HTML()

    def redraw(_: Any = None) -> None:
        values = {name: control.value for name, control in controls.items()}
        try:
            image.value = png(picture(values, LIVE_DPI))
            words.value = f'<p aria-live="polite" style="{_HIDDEN}">{html.escape(alt(values))}</p>'
            error.value = ""
        except Exception as problem:  # shown where the reader looks; a widget's callback would bury it in a log
            error.value = (
                f'<p role="alert" style="color:#b3541e">{type(problem).__name__}: {html.escape(str(problem))}</p>'
            )

    for control in controls.values():
        control.observe(redraw, names="value")
    redraw()
    rows = [_with_play(c, s) for c, s in zip(controls.values(), sliders.values(), strict=True)]
    box = w.VBox([w.Box(rows, layout=w.Layout(flex_flow="row wrap")), image, error, words])
    box.controls, box.image, box.error = controls, image, error
    return box


_HIDDEN = "position:absolute;width:1px;height:1px;overflow:hidden;clip-path:inset(50%)"


def _control(name: str, slider: Slider) -> Any:
    options = [(slider.text(value), value) for value in slider.values]
    style, layout = {"description_width": "initial"}, w.Layout(width="340px", max_width="100%")
    kind = w.ToggleButtons if slider.is_choice else w.SelectionSlider
    if slider.is_choice:
        style, layout = {"description_width": "initial", "button_width": "auto"}, w.Layout(width="auto")
    return kind(options=options, value=slider.start, description=slider.label or name, style=style, layout=layout)


def _with_play(control: Any, slider: Slider) -> Any:
    if not slider.play:
        return control
    play = w.Play(min=0, max=len(slider.values) - 1, value=control.index, interval=120, show_repeat=False)
    w.link((play, "value"), (control, "index"))
    return w.HBox([play, control])
