"""Touched figures, as far as Python makes them; tests/browser/test_touch.py touches them."""

import pytest

from coursekit.teaching.touch import SCENES, touch


@pytest.mark.parametrize("scene", SCENES)
def test_a_touched_figure_is_one_piece_of_html_that_asks_nothing_of_anyone(scene):
    html = touch(scene, alt="A figure with <handles> & words.")._repr_html_()
    assert html.startswith('<div class="touch"') and html.endswith("</script></div>")
    assert "<noscript>" in html and "A figure with &lt;handles&gt; &amp; words." in html
    assert "http" not in html.replace("http://www.w3.org/2000/svg", "")


def test_a_scene_that_is_none_and_a_figure_without_words_are_refused():
    with pytest.raises(ValueError, match="scene: expected one of arc, banana"):
        touch("arcs", alt="An arc.")
    with pytest.raises(ValueError, match="alt: expected a sentence"):
        touch("arc", alt=" ")
