"""The book's text that sets an explorer, reads from it, and has its colours."""

import html
import json
import re
import sys
from pathlib import Path

import pytest

from coursekit.teaching import plotting
from coursekit.teaching.explore import Slider, explore

sys.path.insert(0, str(Path(__file__).parents[1] / "book" / "_ext"))
talking = pytest.importorskip("talking", reason="the book's tools are not installed")


class Line:
    def __init__(self):
        self.figure = plotting.figure(3, 2)
        (self.line,) = plotting.axes(self.figure).plot([0, 1], [0, 1])
        self.moving = [self.line]

    def update(self, scale, gate, on):
        self.line.set_ydata([0, scale])

    @staticmethod
    def facts(scale, gate, on):
        return {"share": f"{scale:g} %"}


@pytest.fixture(scope="module")
def page():
    scales = Slider([1 / 16, 1 / 4, 1.0], start=1.0)
    return explore(Line, name="line", scale=scales, gate=["off", "0.99"], on=[True, False]).html()


def talk(page, link, text="words"):
    complaints = []
    mark = f'<says data-link="{html.escape(link)}">{text}</says>'
    return talking.talk(page + mark, complaints.append)[len(page) :], complaints


@pytest.mark.parametrize(
    ("settings", "positions"),
    [
        ("scale=1/16", {"scale": 0}),
        ("scale=0.25&gate=0.99", {"scale": 1, "gate": 1}),
        ("scale=1&gate=off&on=on", {"scale": 2, "gate": 0, "on": 0}),
    ],
)
def test_a_phrase_sets_values_of_the_grid_however_they_are_written(page, settings, positions):
    phrase, complaints = talk(page, f"#set:line?{settings}", "make <em>it</em> <span>so</span>")
    assert complaints == []
    assert json.loads(html.unescape(re.search(r'data-positions="(.*?)"', phrase)[1])) == positions
    assert 'role="button" tabindex="0"' in phrase and phrase.endswith("make <em>it</em> <span>so</span></span>")


def test_a_fact_is_what_the_explorer_says_at_its_start(page):
    word, complaints = talk(page, "#read:line?share", "1 %")
    assert complaints == [] and 'data-reads="line" data-fact="share">1 %<' in word


@pytest.mark.parametrize(
    ("link", "complaint"),
    [
        ("#set:line?scale=3", "3 is not among 0.0625, 0.25, 1.0"),
        ("#set:line?size=3", "the explorer 'line' has no 'size', but scale, gate, on"),
        ("#set:curve?scale=1", "no explorer 'curve', but line"),
        ("#read:line?nees", "the explorer 'line' knows no 'nees', but share"),
        ("#read:line?share", "the text says 'words', the explorer 'line' begins with '1 %'"),
        ("#colour:truths", "no colour is called 'truths'"),
    ],
)
def test_the_build_complains_of_what_leads_nowhere(page, link, complaint):
    text, complaints = talk(page, link)
    assert text == "words"
    assert len(complaints) == 1 and complaint in complaints[0]


@pytest.mark.parametrize("name", talking.COLOURS)
@pytest.mark.parametrize("paper", [talking.PAPER, talking.NIGHT])
def test_a_coloured_word_can_be_read_by_day_and_by_night(name, paper):
    assert talking.contrast(talking.readable(talking.COLOURS[name], paper), paper) >= 4.5


def test_contrast_is_that_of_the_standard():
    assert talking.contrast("#000000", "#ffffff") == pytest.approx(21)
    assert talking.contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)  # known to fail by a hair


def test_a_symbol_in_the_words_of_a_button_opens_no_entry():
    nodes = pytest.importorskip("docutils.nodes")
    import symbols_in_text

    row = symbols_in_text.symbols.Symbol("00_lab", "$R$", "noise", "m²", "")
    button = [
        nodes.raw("", '<says data-link="#set:a?b=1">', format="html"),
        nodes.Text("smaller "),
        nodes.math("R", "R"),
    ]
    told = nodes.paragraph(
        "", "", *button, nodes.raw("", "</says>", format="html"), nodes.Text(", then "), nodes.math("R", "R")
    )
    page = nodes.section("", nodes.title("", "Part"), told)
    symbols_in_text.explain(page, {"R": row})
    assert [told.index(r) for r in told.findall(nodes.raw) if 'class="symbol"' in r.astext()] == [5]
