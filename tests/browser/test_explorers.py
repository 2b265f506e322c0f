"""Every slider of the built book, moved by keyboard, from a server and from a folder on disk."""

import pytest

from tests.browser.conftest import HTML
from tests.browser.test_pages import every_page_with_sliders

pytestmark = pytest.mark.browser

# The picture as it is on the screen now: the address of its frame, and a digest of its pixels where a page may read
# them (a page from disk may not).
PICTURE = """async (image) => {
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
            shown = slider.evaluate("(s) => s.parentElement.querySelector('output').textContent")
            assert shown == slider.get_attribute("aria-valuetext")
        for group in explorer.locator("fieldset").all():
            assert group.locator("legend").inner_text().strip()


@every_page_with_sliders
def test_play_runs_through_the_values_and_stops(page, site, name):
    for explorer in settle(page, f"{site}/{name}"):
        for button in explorer.locator(".explorer-play").all():
            slider = button.locator("xpath=following-sibling::input").first
            slider.focus()
            page.keyboard.press("Home")
            button.focus()
            page.keyboard.press("Enter")
            end = slider.get_attribute("max")
            page.wait_for_function("([s, end]) => s.value === end", arg=[slider.element_handle(), end])
            assert button.inner_text() == "▶"


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
