import json
import re
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from coursekit import plotting
from coursekit.explore import Slider, collecting, explore, png, sweep


class Wave:
    """A sound scene: one line that moves, over axes that do not."""

    def __init__(self):
        self.figure = plotting.figure(3, 2)
        ax = self.figure.subplots()
        ax.set(xlim=(0, 6), ylim=(-3, 3))
        self.t = np.linspace(0, 6, 50)
        (self.line,) = ax.plot(self.t, self.t)
        self.title = ax.set_title("")
        self.moving = [self.line, self.title]

    def update(self, height, shape):
        self.line.set_ydata(height * {"sin": np.sin, "cos": np.cos}[shape](self.t))
        self.title.set_text(f"{shape} of height {height}")


class Haunted(Wave):
    """Its picture depends on the picture before."""

    def update(self, height, shape):
        self.line.set_ydata(self.line.get_ydata() * 0.5 + height)


def plain(height, shape="sin"):
    fig = plotting.figure(3, 2)
    fig.subplots().plot([0, height])
    return fig


def wave(scene=Wave):
    return explore(scene, height=Slider([1, 2, 3], unit="m"), shape=["sin", "cos"], alt="A {shape}, {height} m.")


def test_the_grid_is_the_product_of_the_declared_values():
    explorer = wave()
    assert len(list(explorer.grid())) == len(explorer) == 6
    assert next(explorer.grid()) == {"height": 1, "shape": "sin"}
    assert explorer.start == {"height": 2, "shape": "sin"}


@pytest.mark.parametrize("scene", [Wave, Wave()], ids=["class", "object"])
def test_a_sound_scene_passes_the_sweep(scene):
    assert sweep(wave(scene)) == []


def test_a_sound_function_passes_the_sweep():
    assert sweep(explore(plain, height=[1, 2], alt="A line up to {height}.")) == []


def test_blitted_pictures_equal_a_full_redraw():
    """But for the few pixels where the line now lies over the frame instead of under it."""
    values, whole = {"height": 3, "shape": "cos"}, Wave()
    whole.moving = []
    blitted, redrawn = wave().picture(values).astype(int), wave(whole).picture(values).astype(int)
    assert np.mean(np.abs(blitted - redrawn).max(axis=-1) > 8) < 1e-3


@pytest.mark.parametrize(
    ("scene", "complaint"),
    [
        (Haunted(), "depends on what was shown before"),
        (lambda height, shape: plain({1: 1, 2: 2}[height]), "raises KeyError"),
        (lambda height, shape: plotting.figure(), "the figure is empty"),
        (lambda height, shape: plain(height), "'shape' never changes"),
        (lambda height, shape: 3, "must return a matplotlib Figure, got int"),
    ],
    ids=["path-dependent", "raises", "empty", "idle slider", "no figure"],
)
def test_the_sweep_finds_what_is_wrong(scene, complaint):
    assert any(complaint in problem for problem in sweep(wave(scene)))


def test_the_sweep_finds_a_text_alternative_that_fails():
    explorer = explore(plain, height=[1, 2], alt="A line {width} wide.")
    assert any("KeyError" in problem for problem in sweep(explorer))


def test_live_controls_move_the_picture_and_show_errors_in_words():
    def fragile(height):
        if height == 3:
            raise ValueError("no picture at three")
        return plain(height)

    widget = explore(fragile, height=[1, 2, 3]).widget()
    first = widget.image.value
    widget.controls["height"].value = 1
    moved = widget.image.value
    assert moved != first
    widget.controls["height"].value = 3
    assert widget.image.value == moved
    assert "no picture at three" in widget.error.value
    widget.controls["height"].value = 2
    assert widget.image.value == first and widget.error.value == ""


def test_a_live_picture_keeps_every_pixel_and_red_stays_red():
    frame = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    frame[:20] = 255, 0, 0
    np.testing.assert_array_equal(np.asarray(Image.open(BytesIO(png(frame)))), frame)


def test_a_play_button_runs_through_the_values():
    widget = explore(plain, height=Slider([1, 2, 3], start=1, play=True)).widget()
    play = widget.children[0].children[0].children[0]
    play.value = 2
    assert widget.controls["height"].value == 3


def test_static_html_holds_every_frame_and_a_labelled_control_for_each_parameter():
    page = wave().html()
    data = json.loads(re.search(r'class="explorer-data">(.*?)</script>', page, re.S)[1])
    assert len(set(data["frames"])) == 6 == len(data["alts"])
    assert data["sizes"] == [3, 2]
    assert data["alts"][0].startswith("A sin, 1 m.")
    identity = re.search(r'id="(explorer-\w+)"', page)[1]
    assert f'<label for="{identity}-height">height</label>' in page
    assert page.count('type="radio"') == 2
    assert "http" not in page


def test_static_html_is_the_same_bytes_each_time():
    assert wave().html() == wave().html()


def test_static_html_escapes_what_an_author_writes():
    page = explore(plain, height=Slider([1, 2], label="<b>"), alt='</script>"').html()
    assert "<b>" not in page
    assert page.count("</script>") == 2


def test_the_form_depends_on_where_it_is_shown(monkeypatch):
    explorer = explore(plain, height=[1, 2])
    assert "application/vnd.jupyter.widget-view+json" in explorer._repr_mimebundle_()
    monkeypatch.setenv("COURSEKIT_STATIC", "1")
    assert explorer._repr_mimebundle_()["text/html"].startswith('<div class="explorer"')


def test_collecting_catches_explorers_and_stops_when_it_ends():
    with collecting() as caught:
        inside = wave()
    wave()
    assert caught == [inside]


@pytest.mark.parametrize("values", [[], [1], [1, 1]])
def test_a_slider_needs_two_different_values(values):
    with pytest.raises(ValueError, match="at least two different values"):
        Slider(values)


def test_a_slider_starts_on_one_of_its_values_and_says_them_with_units():
    assert Slider([0.5, 1, 1.5]).start == 1
    assert Slider(["a", "b"]).start == "a"
    assert Slider(np.array([0.1, -0.25]), unit="m").text(-0.25) == "−0.25 m"
    assert Slider([True, False]).text(True) == "on"
    with pytest.raises(ValueError, match="start: expected one of"):
        Slider([1, 2], start=3)


def test_an_explorer_needs_a_parameter():
    with pytest.raises(ValueError, match="at least one parameter"):
        explore(plain)


def test_sweep_catches_words_that_are_the_same_everywhere():
    problems = sweep(explore(lambda a: _line(round(1e6 * (a - 1))), a=[1.00001, 1.00002]))
    assert problems == ["the text alternative says 'a 1' everywhere"]


def _line(height):
    fig = plotting.figure(3, 2)
    fig.subplots().plot([0, height], [0, 1])
    return fig
