"""The static half of an explorer: every frame in one piece of HTML, and a few lines of JavaScript to swap them."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

from coursekit.teaching.explore.painting import LIVE_DPI, STATIC_DPI, Facts, Picture, Words, is_drawing, webp
from coursekit.teaching.explore.shell import part, shell
from coursekit.teaching.explore.sliders import Slider, grid, start


def static_html(sliders: Mapping[str, Slider], picture: Picture, alt: Words, facts: Facts, name: str = "") -> str:
    """Render the grid and wrap it: labelled inputs, the first frame, every frame's address, words and facts."""
    combinations = list(grid(sliders))
    first = combinations.index(start(sliders))
    shown_first = picture(combinations[first], STATIC_DPI)
    drawing = is_drawing(shown_first)
    with ThreadPoolExecutor(2) as pool:  # encoding leaves the interpreter free to draw the next frame
        drawn = (picture(values, STATIC_DPI) for values in combinations)
        frames = list(pool.map(lambda frame: webp(frame, drawing), drawn))
    alts = [alt(values) for values in combinations]
    height, width = shown_first.shape[:2]
    data = {"frames": frames, "alts": alts, "facts": [facts(values) for values in combinations], "first": first}
    body = shell(sliders, data, (frames[first], alts[first], width, height), round(width * LIVE_DPI / STATIC_DPI), name)
    style = f"<style>{part('explorer.css')}</style>"
    script = (
        f"((root) => {{ ({part('explorer.js')})(root, {part('frames.js')}); ({part('address.js')})(root); }})"
        "(document.currentScript.parentElement);"
    )
    return body.replace(">", f">{style}", 1) + f"<script>{script}</script></div>"
