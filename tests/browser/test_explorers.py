"""Every slider of the built book, moved by keyboard, from a server and from a folder on disk."""

import json
import statistics

import pytest

from tests.browser.conftest import HTML
from tests.browser.test_pages import every_page_with_sliders

pytestmark = pytest.mark.browser

# The picture as it is on the screen now: the address of its frame, and a digest of its pixels where a page may read
# them (a page from disk may not).
PICTURE = """async (image) => {
  await new Promise((settled) => setTimeout(settled)); // the script has heard of the key
  await image.decode();
  const seen = { frame: image.currentSrc, words: image.alt, pixels: "" };
  if (location.protocol === "file:") return seen;
  const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight), pen = canvas.getContext("2d");
  pen.drawImage(image, 0, 0);
  const bytes = pen.getImageData(0, 0, canvas.width, canvas.height).data;
  const digest = await crypto.subtle.digest("SHA-256", bytes);
  seen.pixels = [...new Uint8Array(digest)].map((b) => b.toString(16).padStart(2, "0")).join("");
  return seen;
}"""


def slide(page, control):
    """Put the keyboard on a control, at its first position; how many positions it has."""
    slider = control.locator("input[type=range]")
    if not slider.count():
        control.locator("input:checked").focus()
        return control.locator("input[type=radio]").count()
    slider.focus()
    page.keyboard.press("Home")
    return int(slider.get_attribute("max")) + 1


def walk(page, explorer, control):
    """Go through all positions of a control with the arrow keys and back; what the picture was at each."""
    image, slider = explorer.locator("img"), control.locator("input[type=range]")
    start = int(slider.input_value()) if slider.count() else None
    positions = slide(page, control)
    seen = [image.evaluate(PICTURE)]
    for _ in range(positions - 1):
        page.keyboard.press("ArrowRight")
        seen.append(image.evaluate(PICTURE))
    if start is None:
        page.keyboard.press("ArrowRight")  # round to where it began
    else:
        page.keyboard.press("Home")
        for _ in range(start):
            page.keyboard.press("ArrowRight")
    return seen


def walk_elsewhere(page, explorer, control, others):
    """The walk again with each other control at each of its positions, until one shows a difference."""
    for other in others:
        for k in range(slide(page, other)):
            if k:
                page.keyboard.press("ArrowRight")
            seen = walk(page, explorer, control)
            if len({s["pixels"] for s in seen}) > 1:
                return True
            other.locator("input:checked, input[type=range]").first.focus()
    return False


def settle(page, address):
    page.goto(address, wait_until="load")
    page.wait_for_function("!window.MathJax || window.MathJax.startup.promise")
    return page.locator(".explorer").all()


@every_page_with_sliders
def test_every_control_changes_the_picture_and_its_words(page, site, name):
    explorers = settle(page, f"{site}/{name}")
    assert explorers
    idle = []
    for explorer in explorers:
        explorer.scroll_into_view_if_needed()
        first = explorer.locator("img").evaluate(PICTURE)
        controls = explorer.locator(".explorer-control").all()
        assert controls
        for control in controls:
            label = control.get_attribute("data-name")
            seen = walk(page, explorer, control)
            assert len({s["words"] for s in seen}) == len(seen), f"{label}: two settings with the same words"
            assert explorer.locator("img").evaluate(PICTURE) == first, f"{label}: the way back leads elsewhere"
            if len({s["pixels"] for s in seen}) == 1:
                idle.append((explorer, control))
    # A control may have nothing to say at the start values: a gate, when nothing is surprising.
    for explorer, control in idle:
        label, others = control.get_attribute("data-name"), explorer.locator(".explorer-control").all()
        others = [c for c in others if c.get_attribute("data-name") != label]
        assert walk_elsewhere(page, explorer, control, others), f"{label} does not change the picture"
    assert page.complaints == []


@every_page_with_sliders
def test_sliders_work_from_a_folder_on_disk(page, name):
    for explorer in settle(page, (HTML / name).as_uri()):
        explorer.scroll_into_view_if_needed()
        controls = explorer.locator(".explorer-control").all()
        seen = [s for control in controls for s in walk(page, explorer, control)]
        assert len({s["frame"] for s in seen}) > len(controls) > 0
        assert all(s["frame"].startswith("file://") for s in seen)
    assert page.complaints == []


@every_page_with_sliders
def test_controls_have_names_and_say_their_values(page, site, name):
    for explorer in settle(page, f"{site}/{name}"):
        for slider in explorer.locator("input[type=range]").all():
            assert slider.evaluate("(s) => s.labels.length === 1 && s.labels[0].textContent.trim() !== ''")
            before = slider.get_attribute("aria-valuetext")
            slider.focus()
            page.keyboard.press("Home" if int(slider.input_value()) else "End")
            assert slider.get_attribute("aria-valuetext") != before
            shown = slider.evaluate("(s) => s.closest('.explorer-control').querySelector('output').textContent")
            assert shown == slider.get_attribute("aria-valuetext")
        for group in explorer.locator("fieldset").all():
            assert group.locator("legend").inner_text().strip()


@every_page_with_sliders
def test_play_runs_through_the_values_and_stops(page, site, name):
    for explorer in settle(page, f"{site}/{name}"):
        for button in explorer.locator(".explorer-play").all():
            slider = button.locator("xpath=..").locator("input")
            slider.focus()
            page.keyboard.press("Home")
            button.focus()
            page.keyboard.press("Enter")
            end = slider.get_attribute("max")
            page.wait_for_function("([s, end]) => s.value === end", arg=[slider.element_handle(), end])
            page.wait_for_function("(b) => b.textContent === '▶'", arg=button.element_handle())


def test_a_frame_is_fetched_when_it_is_needed_and_not_before(page, site):
    """A page with a hundred frames an explorer asks for a handful until somebody moves a slider."""
    name = max(
        every_page_with_sliders.args[1], key=lambda n: (HTML / n).read_text(encoding="utf-8").count(".webp"), default=""
    )
    if not name:
        pytest.fail("no page of the book has a slider")
    asked = []
    page.on("request", lambda r: asked.append(r.url) if "/explorers/" in r.url else None)
    explorers = settle(page, f"{site}/{name}")
    page.wait_for_timeout(500)
    assert len(asked) <= 12 * len(explorers)


TALKING = [n for n in every_page_with_sliders.args[1] if 'class="explorer-set"' in (HTML / n).read_text("utf-8")]


# A phrase may stand in an answer that is still folded.
UNFOLD = "(p) => { for (let d = p.closest('details'); d; d = d.parentElement.closest('details')) d.open = true; }"


@pytest.mark.parametrize("name", TALKING)
def test_a_phrase_sets_the_explorer_keeps_the_focus_and_the_text_follows(page, site, name):
    settle(page, f"{site}/{name}")
    for phrase in page.locator(".explorer-set").all():
        explorer = page.locator(f'.explorer[data-explorer="{phrase.get_attribute("data-sets")}"]')
        phrase.evaluate(UNFOLD)
        phrase.focus()
        page.keyboard.press("Enter")
        explorer.locator("img").evaluate(PICTURE)
        for parameter, position in json.loads(phrase.get_attribute("data-positions")).items():
            control = explorer.locator(f'[data-name="{parameter}"]')
            assert control.locator("input[type=range], input:checked").input_value() == str(position)
        assert phrase.evaluate("(p) => p === document.activeElement")
        for word in page.locator(f'.explorer-read[data-reads="{phrase.get_attribute("data-sets")}"]').all():
            assert word.text_content() == explorer.evaluate(
                "(e, name) => e.facts[name]", word.get_attribute("data-fact")
            )
    assert page.complaints == []


@pytest.mark.parametrize("width", [1440, 1920])
def test_a_figure_stays_beside_its_section_on_a_wide_screen_and_in_its_place_on_a_narrow_one(page, site, width):
    beside = [n for n in every_page_with_sliders.args[1] if "tag_beside" in (HTML / n).read_text("utf-8")]
    assert beside
    page.set_viewport_size({"width": width, "height": 900})
    settle(page, f"{site}/{beside[0]}")
    cell, text = page.locator(".tag_beside").first, page.locator("section:has(> .tag_beside) > p").first
    left, right = text.bounding_box(), cell.bounding_box()
    assert left["x"] + left["width"] <= right["x"] and right["x"] + right["width"] <= width
    assert cell.evaluate("(c) => getComputedStyle(c).position") == "sticky"
    page.set_viewport_size({"width": 1100, "height": 900})
    assert cell.evaluate("(c) => getComputedStyle(c).position") == "static"
    assert cell.bounding_box()["y"] >= text.bounding_box()["y"] + text.bounding_box()["height"]


# From the input event to the decoded picture, for each step of each slider there and back, in ms.
LATENCY = """async (explorer) => {
  const image = explorer.querySelector("img"), times = [];
  const settled = () => new Promise((resolve) => setTimeout(resolve, 60));
  for (const input of explorer.querySelectorAll("input[type=range]")) {
    for (const way of [1, -1]) for (let k = 0; k < 3; k++) {
      input.value = Number(input.value) + way;
      const before = image.src, began = performance.now();
      input.dispatchEvent(new Event("input", { bubbles: true }));
      await Promise.resolve();
      await Promise.resolve();
      if (image.src === before) continue; // the end of the slider
      await image.decode();
      times.push(performance.now() - began);
      await settled();
    }
  }
  return times;
}"""


@every_page_with_sliders
def test_a_picture_follows_its_slider_at_once(page, site, name):
    """The median: one step may meet another process on a busy machine."""
    times = []
    for explorer in settle(page, f"{site}/{name}"):
        explorer.scroll_into_view_if_needed()
        page.wait_for_timeout(500)
        times += explorer.evaluate(LATENCY)
    assert statistics.median(times) < 50, "15 ms on an idle machine"
    print(f"{name}: median {statistics.median(times):.1f} ms of {len(times)}")
