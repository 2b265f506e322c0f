import base64
import gc
import json
import re
import weakref
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from coursekit.teaching import plotting
from coursekit.teaching.explore import Slider, collecting, explore, guess, png, sweep


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


def cut_off(height):
    fig = plain(height)
    fig.suptitle("a title that is much too long for such a small figure", fontsize=20)
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
        (lambda height, shape: cut_off(height), "ink at its edge"),
        (lambda height, shape: 3, "must return a matplotlib Figure, got int"),
    ],
    ids=["path-dependent", "raises", "empty", "idle slider", "cut off", "no figure"],
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
    said, [first] = widget.answer([1])
    assert widget.still.endswith(base64.b64encode(first).decode()) and said["alt"] == widget.words
    assert widget.answer([0])[1] != [first]
    assert widget.answer([2]) == ({"error": "ValueError: no picture at three"}, [])
    assert widget.answer([1])[1] == [first]


def test_a_live_picture_that_was_drawn_is_not_drawn_again():
    drawn = []
    widget = explore(lambda height: drawn.append(height) or plain(height), height=[1, 2, 3]).widget()
    for position in (0, 2, 0, 2, 0):
        widget.answer([position])
    assert drawn == [2, 1, 3]


def test_a_live_picture_keeps_every_pixel_and_red_stays_red():
    frame = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    frame[:20] = 255, 0, 0
    np.testing.assert_array_equal(np.asarray(Image.open(BytesIO(png(frame)))), frame)


def run_cell(shell, cell, run, source):
    """Run a cell as a front end does that says which one it is."""
    shell.get_parent = lambda: {"metadata": {"cellId": cell}, "header": {"msg_id": run}}
    shell.run_cell(source, store_history=True, silent=False)


@pytest.fixture
def shell(monkeypatch):
    """An IPython in this process, with the test's scene in its names."""
    from IPython.core.interactiveshell import InteractiveShell

    from coursekit.teaching.explore import live

    made = InteractiveShell()
    made.user_ns |= {"explore": explore, "Wave": Wave, "scenes": weakref.WeakSet()}
    monkeypatch.setattr(live, "get_ipython", lambda: made)
    monkeypatch.setattr(live, "_shown", {})
    return made


def count(shell, name):
    gc.collect()
    return len(shell.user_ns[name])


def test_a_cell_that_is_run_again_frees_its_old_scene_and_widgets(shell):
    from ipywidgets import Widget
    from ipywidgets.widgets.widget import _instances

    def cell():
        wave = Wave()
        shell.user_ns["scenes"].add(wave)
        return explore(wave, height=[1, 2], shape=["sin", "cos"])

    shell.user_ns["cell"] = cell
    assert issubclass(type(cell().widget()), Widget)
    gc.collect()
    before = set(_instances)
    for run in range(5):
        run_cell(shell, "a", f"run {run}", "cell()")
    assert count(shell, "scenes") == 1 + 1
    assert len(set(_instances) - before) == 2  # the widget and its layout
    run_cell(shell, "b", "run 9", "cell()")
    assert count(shell, "scenes") == 1 + 2


def test_an_explorer_shown_many_times_is_one_widget_and_survives_the_next_run(shell):
    from ipywidgets.widgets.widget import _instances

    before = set(_instances)
    shell.user_ns |= {"e": wave(), "show": shell.display_formatter.format}
    for run in range(3):
        run_cell(shell, "a", f"run {run}", "for i in range(5): show(e)")
    assert len(set(_instances) - before) == 2, [type(w) for k, w in _instances.items() if k not in before]
    assert shell.user_ns["e"].widget().answer([0, 0])[1]


def test_static_html_holds_every_frame_and_a_labelled_control_for_each_parameter():
    page = wave().html()
    data = json.loads(re.search(r'class="explorer-data">(.*?)</script>', page, re.S)[1])
    assert len(set(data["frames"])) == 6 == len(data["alts"])
    assert data["sizes"] == [3, 2]
    assert data["alts"][0].startswith("A sin, 1 m.")
    assert '<label><span class="explorer-name">height</span><input type="range"' in page
    assert ' id="' not in page, "two copies in one page would be in each other's way"
    assert "<form" in page and 'autocomplete="on" hidden>' in page, "without scripts, no dead controls"
    assert 'aria-label="Interactive figure: height, shape"' in page
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
    live = explorer._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in live
    monkeypatch.setenv("COURSEKIT_STATIC", "1")
    assert explorer._repr_mimebundle_()["text/html"].startswith('<div class="explorer"')


def test_collecting_catches_explorers_and_stops_when_it_ends():
    with collecting() as caught:
        inside = wave()
    wave()
    assert caught == [inside]


def test_a_saved_notebook_shows_a_still_picture_without_a_kernel():
    import nbformat
    from nbconvert import HTMLExporter

    data = explore(plain, height=[1, 2], alt="A line.")._repr_mimebundle_()
    cell = nbformat.v4.new_code_cell("explorer", outputs=[nbformat.v4.new_output("display_data", data)])
    page, _ = HTMLExporter().from_notebook_node(nbformat.v4.new_notebook(cells=[cell]))
    picture = re.search(r'<img alt="A line. \(height 1\)" src="data:image/png;base64,(.+?)"', page)
    assert Image.open(BytesIO(base64.b64decode(picture[1]))).size == (300, 200)


@pytest.mark.parametrize(
    ("values", "error", "words"),
    [
        ([1, float("nan"), float("nan")], ValueError, "finite numbers"),
        ([1, float("inf")], ValueError, "finite numbers"),
        ([[1], [2]], TypeError, r"numbers, strings or booleans, got \[1\]"),
        ([1, None], TypeError, "numbers, strings or booleans, got None"),
    ],
)
def test_a_slider_refuses_what_is_no_value(values, error, words):
    with pytest.raises(error, match=words):
        Slider(values)


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


@pytest.mark.parametrize(
    ("truth", "sigma", "words"),
    [(float("nan"), None, "truth: expected a finite"), (1.0, 0.0, "sigma: expected"), (1.0, -1.0, "sigma: expected")],
)
def test_a_guess_needs_a_truth_and_a_positive_spread(truth, sigma, words):
    with pytest.raises(ValueError, match=words):
        guess("How far?", truth, sigma=sigma)


def test_a_guess_escapes_what_an_author_writes_and_hides_the_form_without_scripts():
    page = guess('<b>"?', 1.0, unit="</script>", why="<i>")._repr_html_()
    assert "<b>" not in page and "<i>" not in page and page.count("</script>") == 1
    assert 'autocomplete="off" hidden>' in page
