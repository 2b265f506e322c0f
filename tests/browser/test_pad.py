"""Lab 0's pad: driven by keys alone, stopped by Stop, and never ahead of its kernel."""

from importlib.resources import files

import pytest

pytestmark = pytest.mark.browser
KERNEL = """
const asked = window.asked = [], answers = [];
const model = {
  get: () => [0.1, 0.9, 0.2, 2.0],
  on: (name, answer) => answers.push(answer),
  send: (question) => {
    asked.push(question);
    const moves = Boolean(question.drive && (question.drive[0] || question.drive[1]));
    setTimeout(() => answers[0]({ alt: `Picture ${asked.length}`, moves }, [new Uint8Array([137])]), 20);
  },
};
pad.render({ model, el: document.body });
"""


@pytest.fixture
def pad(page):
    script = files("coursekit.labs.lab00").joinpath("pad.js").read_text(encoding="utf-8")
    page.set_content("<!doctype html><title>pad</title><body></body>")
    page.add_script_tag(content=script.replace("export default", "const pad =") + KERNEL)
    page.locator(".pad").focus()
    return page


def command(page):
    return page.locator(".pad-says").inner_text()


def test_arrows_and_letters_drive(pad):
    for key in ("ArrowUp", "w", "a"):
        pad.keyboard.press(key)
    assert command(pad) == "Command: 0.2 m/s, 0.2 rad/s"
    pad.wait_for_function("asked.some((q) => q.drive && q.drive[0] === 0.2 && q.drive[1] === 0.2)")
    for key in ("ArrowDown", "s", "s", "ArrowRight", "d"):
        pad.keyboard.press(key)
    assert command(pad) == "Command: -0.1 m/s, -0.2 rad/s"


def test_stop_stops_and_nothing_is_asked_of_a_robot_that_stands(pad):
    pad.keyboard.press("ArrowUp")
    pad.wait_for_function("asked.length > 2")
    pad.get_by_role("button", name="Stop").click()
    pad.wait_for_function("asked[asked.length - 1].drive[0] === 0")
    pad.wait_for_timeout(300)
    count = pad.evaluate("asked.length")
    pad.wait_for_timeout(400)
    assert pad.evaluate("asked.length") == count and command(pad) == "Command: 0.0 m/s, 0.0 rad/s"


def test_back_to_the_start_asks_for_it_and_the_picture_has_words(pad):
    pad.keyboard.press("w")
    pad.get_by_role("button", name="Back to the start").click()
    pad.wait_for_function("asked.some((q) => q.reset)")
    pad.wait_for_function("document.querySelector('img').alt.startsWith('Picture')")


def test_the_space_bar_presses_a_button_that_has_the_focus_and_stops_elsewhere(pad):
    pad.get_by_role("button", name="faster").focus()
    pad.keyboard.press("Space")
    assert command(pad) == "Command: 0.1 m/s, 0.0 rad/s"
    pad.locator(".pad").focus()
    pad.keyboard.press("Space")
    assert command(pad) == "Command: 0.0 m/s, 0.0 rad/s"
