"""Figures that are touched: their mathematics is the package's, and each answers the mouse and the keyboard."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from coursekit import ekf, particles
from coursekit.gaussian import Gaussian, ellipse, mahalanobis_squared
from coursekit.geometry import compose, inverse, transform, wrap_angle
from coursekit.icp import point_to_point
from coursekit.models import DifferentialDrive, RangeBearing
from coursekit.teaching.touch import SCENES, guess_ellipse, guess_point, part, touch

pytestmark = pytest.mark.browser
WORDS = "A figure that is touched."


class Fixed(np.random.Generator):
    """A generator whose next random number is known."""

    def __init__(self, value):
        super().__init__(np.random.PCG64(0))
        self.value = value

    def random(self, size=None):
        return self.value


def inputs(n):
    rng = np.random.default_rng(11)
    for _ in range(n):
        root = rng.normal(size=(3, 3))
        yield {
            "a": rng.uniform(-4, 4, 3), "b": rng.uniform(-4, 4, 3), "p": rng.uniform((4, -5), (14, 5)),
            "u": [rng.uniform(-1, 1), rng.choice([0.0, 1e-5, rng.uniform(-2, 2)])], "dt": rng.uniform(0.01, 2),
            "P": root @ root.T + 0.1 * np.eye(3), "M": np.diag(rng.uniform(0.01, 0.2, 2)),
            "R": np.diag(rng.uniform(0.01, 0.5, 2)), "z": [rng.uniform(1, 9), rng.uniform(-3, 3)],
            "w": rng.uniform(0.01, 1, 7), "t": rng.uniform(0, 1),
            "s": rng.normal(size=(9, 2)), "q": rng.normal(size=(9, 2)),
        }  # fmt: skip


def ours(i):
    """What the package makes of an input, by name."""

    class Odometry(DifferentialDrive):
        def root_M(self, u, dt):
            return np.linalg.cholesky(i["M"])

    x, motion = i["a"], Odometry(sigma_pose=(0.0, 0.0, 0.0))
    belief = Gaussian(x, i["P"])
    predicted = motion.f(x, i["u"], i["dt"]), motion.F(x, i["u"], i["dt"]), motion.G(x, i["u"], i["dt"])
    F, G = predicted[1:]
    fixed = ekf.correct(belief, RangeBearing(i["p"], i["R"]), i["z"])
    T = point_to_point(i["s"], i["q"])
    return {
        "wrap": wrap_angle(7 * x[2]), "compose": compose(x, i["b"]), "inverse": inverse(x),
        "transform": transform(x, i["p"]),
        "move": predicted[0], "F": F, "G": G,
        "predict": [predicted[0], F @ i["P"] @ F.T + G @ i["M"] @ G.T],
        "see": RangeBearing(i["p"]).h(x), "H": RangeBearing(i["p"]).H(x),
        "correct": [fixed.belief.mean, fixed.belief.cov, fixed.nis],
        "innovation": fixed.innovation_cov, "distance2": mahalanobis_squared(i["p"], i["R"]),
        "systematic": particles.systematic(i["w"], Fixed(1 - i["t"])),
        "register": [T[0, 2], T[1, 2], np.arctan2(T[1, 0], T[0, 0])],
        "ellipse": ellipse(i["P"][:2, :2], points=49),
    }  # fmt: skip


THEIRS = """(inputs) => { const r = (ROBOTICS)(); return inputs.map((i) => ({
  wrap: r.wrap(7 * i.a[2]), compose: r.compose(i.a, i.b), inverse: r.inverse(i.a), transform: r.transform(i.a, i.p),
  move: r.move(i.a, i.u, i.dt), F: r.F(i.a, i.u, i.dt), G: r.G(i.a, i.u, i.dt),
  predict: r.predict(i.a, i.P, i.u, i.M, i.dt), see: r.see(i.a, i.p), H: r.H(i.a, i.p),
  correct: r.correct(i.a, i.P, i.p, i.z, i.R),
  innovation: r.innovation(i.a, i.P, i.p, i.R), distance2: r.distance2(i.p, i.R), systematic: r.systematic(i.w, i.t),
  register: r.register(i.s, i.q), ellipse: r.ellipse(i.P.slice(0, 2).map((row) => row.slice(0, 2))) })); }"""


def flat(value):
    return [n for v in value for n in flat(v)] if isinstance(value, (list, tuple, np.ndarray)) else [float(value)]


def test_the_mathematics_of_the_page_is_that_of_the_package(page):
    given = list(inputs(1000))
    sent = json.loads(json.dumps(given, default=lambda a: a.tolist()))
    for i, theirs in zip(given, page.evaluate(THEIRS.replace("ROBOTICS", part("robotics.js")), sent), strict=True):
        for name, value in ours(i).items():
            got, wanted = np.array(flat(theirs[name])), np.array(flat(value))
            difference = wrap_angle(got - wanted) if name in {"wrap", "compose", "inverse"} else got - wanted
            np.testing.assert_allclose(difference, 0, atol=1e-9 * max(1, np.abs(wanted).max()), err_msg=name)


@pytest.fixture
def show(page, tmp_path):
    def opened(scene):
        faults = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        html = (touch(scene, alt=WORDS) if isinstance(scene, str) else scene)._repr_html_()
        (tmp_path / "touch.html").write_text(f"<!doctype html><meta charset=utf-8><body>{html}", encoding="utf-8")
        page.goto((tmp_path / "touch.html").as_uri())
        assert faults == []
        return page

    return opened


def test_a_drawing_keeps_its_colours_beside_the_book_s_coloured_code_and_its_words_their_size_on_a_phone(show):
    page = show(guess_point("Where?", [1, 0], extent=(-6, 6, -4, 4), scenery=[("highlight thin", [[0, 0], [5, 0]])]))
    page.add_style_tag(content="html[data-theme=light] .highlight { color: #545454 }")
    page.evaluate("document.documentElement.dataset.theme = 'light'")
    assert page.evaluate("getComputedStyle(document.querySelector('.touch .highlight')).stroke") == "rgb(230, 159, 0)"
    page = show("gate")
    page.set_viewport_size({"width": 360, "height": 800})
    size = "(t) => parseFloat(getComputedStyle(t).fontSize) * t.getScreenCTM().a"
    assert min(page.evaluate(f"[...document.querySelectorAll('.touch-text')].map({size})")) > 9


@pytest.mark.parametrize("scene", SCENES)
def test_every_handle_answers_the_keyboard_and_says_where_it_is(show, scene):
    page = show(scene)
    handles = page.locator(".touch-handle")
    assert handles.count() >= 1
    for k in range(handles.count()):
        handle = handles.nth(k)
        name, told = handle.get_attribute("aria-label"), handle.get_attribute("aria-valuetext")
        words = page.locator(".touch-result").inner_text()
        handle.focus()
        for key in ("Shift+ArrowUp", "Shift+ArrowLeft"):
            page.keyboard.press(key)
        again = page.locator(f'.touch-handle[aria-label="{name}"]')
        assert again.get_attribute("aria-valuetext") != told
        assert page.locator(".touch-result").inner_text() != words
        assert page.evaluate("document.activeElement.getAttribute('aria-label')") == name


@pytest.mark.parametrize("scene", SCENES)
def test_a_handle_follows_the_mouse(show, scene):
    page = show(scene)
    handle, before = page.locator(".touch-handle").first, page.locator(".touch-result").inner_text()
    box = handle.locator(".touch-grip").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 40, y - 25, steps=4)
    page.mouse.up()
    assert page.locator(".touch-result").inner_text() != before
    assert "NaN" not in page.content().replace("isNaN", "")


def test_an_icp_step_brings_the_scan_nearer(show):
    page = show("pairs")

    def rms():
        return float(re.search(r"pairs ([\d.]+) m", page.locator(".touch-result").inner_text())[1])

    before = rms()
    for _ in range(20):
        page.get_by_role("button", name="One step").click()
    assert rms() < 0.2 * before
    page.get_by_role("button", name="Start again").click()
    assert rms() == before


def test_a_gate_takes_what_is_near_and_refuses_what_is_far(show):
    page = show("gate")
    assert "Taken" in page.locator(".touch-result").inner_text()
    page.get_by_role("slider", name="Where the landmark is seen").focus()
    for _ in range(3):
        page.keyboard.press("Shift+ArrowDown")
    assert "Refused: the belief stays as it was" in page.locator(".touch-result").inner_text()


def test_an_ellipse_holds_its_share_of_the_endings_until_the_cloud_bends(show):
    page = show("banana")

    def share():
        return int(re.search(r"holds (\d+) %", page.locator(".touch-result").inner_text())[1])

    assert 91 <= share() <= 99
    page.get_by_role("slider", name="Spread of the heading at the end").focus()
    for _ in range(7):
        page.keyboard.press("Shift+ArrowUp")
    assert share() <= 90 and "cannot bend" in page.locator(".touch-result").inner_text()


def test_resampling_moves_a_cloud_to_its_weights_and_starting_again_undoes_it(show):
    page = show("cloud")

    def effective():
        return int(re.search(r"size (\d+) of", page.locator(".touch-result").inner_text())[1])

    before = effective()
    page.get_by_role("button", name="Resample").click()
    assert effective() > 1.2 * before
    page.get_by_role("button", name="Start again").click()
    assert effective() == before


def test_resampling_alone_leaves_ever_fewer_places_as_lab_7_says(show):
    page = show("cloud")
    places = []
    for _ in range(6):
        places.append(int(re.search(r"(\d+) different place", page.locator(".touch-result").inner_text())[1]))
        page.get_by_role("button", name="Resample").click()
    assert places == sorted(places, reverse=True) and (places[0], places[5]) == (80, 17)
    notebook = (Path(__file__).parents[2] / "notebooks" / "07_particle_filter.ipynb").read_text(encoding="utf-8")
    assert "from 80 to 17" in notebook


def test_a_range_is_measured_anew_after_each_drive_and_the_cloud_lives_until_the_edge(show):
    page = show("cloud")
    heard, alive = [], []
    while "has reached the edge" not in (said := page.locator(".touch-result").inner_text()):
        heard.append(re.search(r"measured ([\d.]+)", said)[1])
        alive.append(int(re.search(r"size (\d+) of", said)[1]))
        assert len(heard) < 12
        page.get_by_role("button", name="Resample").click()
        page.get_by_role("button", name="Drive on").click()
    assert len(heard) >= 6 and len(set(heard)) == len(heard) and alive[-1] > alive[0] and min(alive) > 8
    frame = page.locator("svg").bounding_box()
    for kind in ("truth", "estimate"):
        robot = page.locator(f".touch-robot.{kind}").bounding_box()
        assert frame["x"] < robot["x"] and robot["x"] + robot["width"] < frame["x"] + frame["width"]
    assert page.get_by_text("weighted mean", exact=True).is_visible()


# Home, a little short, wrong by metres: what the answer below the figure says of each.
@pytest.mark.parametrize(
    ("turn", "apart", "turned"), [(0.2, 0.0, 0.0), (0.3, 0.0, 0.0), (0.35, 0.07, 0.05), (1.5, 0.07, 0.05),
                                  (-1.8, 0.08, 0.05), (1.7, 2.18, 2.54), (-2.2, 1.80, 2.69)]
)  # fmt: skip
def test_icp_settles_at_home_or_short_of_it_or_metres_away(show, turn, apart, turned):
    page = show("pairs")
    page.get_by_role("slider", name="Turn of the scan").focus()
    for _ in range(round(abs(turn - 0.2) / 0.05)):
        page.keyboard.press("ArrowUp" if turn > 0.2 else "ArrowDown")
    said = page.locator(".touch-result")
    assert f"θ = {turn:.2f} rad" in said.inner_text() and "settled" not in said.inner_text()
    page.get_by_role("button", name="Run until settled").click()
    x, y, theta = map(float, re.search(r"x = (\S+) m, y = (\S+) m, θ = (\S+) rad", said.inner_text()).groups())
    assert np.hypot(x, y) == pytest.approx(apart, abs=0.01) and abs(theta) == pytest.approx(turned, abs=0.01)
    assert "settled" in said.inner_text()
    steps = re.search(r"after \d+ step", said.inner_text())[0]
    page.get_by_role("button", name="One step").click()
    assert steps in said.inner_text()


def test_only_handles_are_orange_where_a_scan_is_dragged(show):
    page = show("pairs")
    assert page.locator("svg .highlight, svg .measurement").count() == 0


def test_the_wheels_begin_with_the_point_they_turn_about_in_sight(show):
    page = show("arc")
    frame, dot = page.locator("svg").bounding_box(), page.locator(".touch-dot.truth").bounding_box()
    for at, size in (("x", "width"), ("y", "height")):
        assert frame[at] < dot[at] and dot[at] + dot[size] < frame[at] + frame[size]


@pytest.mark.parametrize("scene", SCENES)
def test_home_end_and_page_keys_move_a_handle_and_not_the_page(show, scene):
    page = show(scene)
    page.evaluate("document.body.style.height = '4000px'; scrollTo(0, 100)")
    handles = page.locator(".touch-handle")
    for k in range(handles.count()):
        handle = handles.nth(k)
        handle.evaluate("(h) => h.focus({ preventScroll: true })")
        page.keyboard.press("Home")
        told = [handle.get_attribute("aria-valuetext")]
        for key in ("End", "Home", "PageUp", "PageDown"):
            page.keyboard.press(key)
            told.append(handle.get_attribute("aria-valuetext"))
        assert told[0] == told[2] != told[1]
        assert told[3] != told[2]  # a big step up is seen from the lower limit
    page.wait_for_timeout(200)
    assert page.evaluate("scrollY") == 100


def test_a_turn_goes_on_past_a_right_angle_by_arrow_keys(show):
    page = show("pairs")
    page.get_by_role("slider", name="Turn of the scan").focus()
    for _ in range(5):
        page.keyboard.press("Shift+ArrowUp")
    assert "θ = 2.70 rad" in page.locator(".touch-result").inner_text()


@pytest.mark.parametrize(("scene", "ways"), [("arc", 2), ("banana", 2), ("ranging", 0), ("gate", 1), ("pairs", 1)])
def test_a_handle_with_one_direction_shows_it(show, scene, ways):
    page = show(scene)
    assert page.locator(".touch-way:not([d=''])").count() == ways


@pytest.fixture
def phone(page, show):
    """A figure between two empty screens on a phone, and a finger for it."""
    touching = page.context.new_cdp_session(page)
    page.set_viewport_size({"width": 390, "height": 844})
    touching.send("Emulation.setTouchEmulationEnabled", {"enabled": True})

    def opened(scene):
        show(scene)
        page.evaluate("""() => {
          document.head.insertAdjacentHTML("beforeend", "<meta name=viewport content='width=device-width'>");
          document.body.style.padding = "900px 21px 1200px"; // with these margins a figure is as wide as in the book
          document.querySelector("svg").scrollIntoView({ block: "center" });
        }""")

        def swipe(x, y, dx, dy):
            points = [[{"x": x + dx * i / 12, "y": y + dy * i / 12}] for i in range(13)]
            for i, at in enumerate(points):
                touching.send(
                    "Input.dispatchTouchEvent", {"type": "touchMove" if i else "touchStart", "touchPoints": at}
                )
                page.wait_for_timeout(16)
            touching.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
            page.wait_for_timeout(100)

        return swipe

    yield opened
    touching.send("Emulation.setTouchEmulationEnabled", {"enabled": False})


def middle(locator):
    box = locator.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


# Where each figure's first free handle is, and which way a finger takes it: down, or up and to the side.
@pytest.mark.parametrize("way", [(0, 60), (40, -24)], ids=["down", "slanted"])
@pytest.mark.parametrize("scene", [*SCENES, "guess"])
def test_a_finger_that_starts_on_a_handle_drags_it_and_does_not_scroll(page, phone, scene, way):
    finger = phone(scene if scene != "guess" else guess_ellipse("Where?", CLOUD, extent=(-6, 6, -4, 4)))
    page.evaluate("""() => {
      window.ended = [];
      ["pointercancel", "pointerup"].forEach((kind) => addEventListener(kind, () => ended.push(kind), true));
    }""")
    for name in page.locator(".touch-handle").evaluate_all("(all) => all.map((h) => h.getAttribute('aria-label'))"):
        handle, before = page.locator(f'.touch-handle[aria-label="{name}"]'), page.evaluate("scrollY")
        x, y = middle(handle.locator(".touch-grip"))
        finger(x, y, *way)
        at = middle(handle.locator(".touch-grip"))
        assert page.evaluate("scrollY") == before
        if scene in ("ranging", "cloud"):  # free in both directions, and far from their limits
            assert at == pytest.approx((x + way[0], y + way[1]), abs=3)
    assert set(page.evaluate("ended")) == {"pointerup"}


def test_a_finger_on_the_empty_part_of_a_figure_scrolls_the_page(page, phone):
    finger, before = phone("ranging"), page.evaluate("scrollY")
    box = page.locator("svg").bounding_box()
    finger(box["x"] + 0.85 * box["width"], box["y"] + 0.85 * box["height"], 0, -120)
    assert page.evaluate("scrollY") > before + 60


@pytest.mark.parametrize("scene", SCENES)
def test_on_a_phone_words_can_be_read_and_handles_be_hit(page, phone, scene):
    phone(scene)
    scale = page.locator("svg").bounding_box()["width"] / 640
    sizes = page.locator(".touch-text").evaluate_all(
        "(all) => all.map((t) => parseFloat(getComputedStyle(t).fontSize))"
    )
    assert all(scale * size >= 9 for size in sizes)
    assert all(box["width"] >= 32 for box in (h.bounding_box() for h in page.locator(".touch-reach").all()))


def test_where_two_handles_are_close_the_nearer_one_is_taken(page, phone):
    finger = phone("arc")
    left = page.locator('.touch-handle[aria-label="Speed of the left wheel"]')
    right = page.locator('.touch-handle[aria-label="Speed of the right wheel"]')
    finger(*middle(right.locator(".touch-grip")), middle(left)[0] - middle(right)[0], 0)  # one above the other
    told = [h.get_attribute("aria-valuetext") for h in (left, right)]
    x, y = middle(left.locator(".touch-grip"))
    finger(x, y + 14, 40, 0)
    assert left.get_attribute("aria-valuetext") != told[0] and right.get_attribute("aria-valuetext") == told[1]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_figure_in_the_book_stands_out_from_what_is_behind_it(page, site, scheme):
    page.emulate_media(color_scheme=scheme)
    page.goto(f"{site}/notebooks/00_the_world.html")
    assert page.locator(".touch").count() >= 3
    ratios = page.locator(".touch-result, .touch-hint, .touch-line.truth, .touch-robot.truth").evaluate_all(CONTRAST)
    assert len(ratios) >= 6 and min(ratios) >= 4.5


CONTRAST = """(all) => {
  const numbers = (text) => { const n = text.match(/[\\d.]+/g).map(Number); return n.length > 3 ? n : [...n, 1]; };
  const channel = (v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
  return all.map((e) => {
    let behind = e;
    while (numbers(getComputedStyle(behind).backgroundColor)[3] === 0) behind = behind.parentElement;
    const pair = [numbers(getComputedStyle(e).color), numbers(getComputedStyle(behind).backgroundColor)].map(light);
    return (Math.max(...pair) + 0.05) / (Math.min(...pair) + 0.05);
  });
}"""


def test_the_sentence_is_spoken_after_a_pause_only(show):
    page = show("filter")
    page.wait_for_function("document.querySelector('.touch-words').textContent !== ''")
    page.locator(".touch-handle").first.focus()
    page.keyboard.press("ArrowRight")
    assert page.locator(".touch-words").inner_text() != page.locator(".touch-result").inner_text()
    page.wait_for_function(
        "document.querySelector('.touch-words').textContent === document.querySelector('.touch-result').textContent"
    )


def test_two_copies_of_a_figure_do_not_know_each_other(page, tmp_path):
    html = touch("ranging", alt=WORDS)._repr_html_() * 2
    (tmp_path / "two.html").write_text(f"<!doctype html><meta charset=utf-8><body>{html}", encoding="utf-8")
    page.goto((tmp_path / "two.html").as_uri())
    other = page.locator(".touch-result").nth(1).inner_text()
    page.locator(".touch-handle").first.focus()
    page.keyboard.press("Shift+ArrowRight")
    assert (
        page.locator(".touch-result").nth(1).inner_text() == other != page.locator(".touch-result").first.inner_text()
    )


CLOUD = np.random.default_rng(3).normal(size=(400, 2)) * [1.0, 0.5]


def drag(page, name, by):
    box = page.locator(f'.touch-handle[aria-label="{name}"] .touch-grip').bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by[0], y + by[1], steps=3)
    page.mouse.up()


def test_an_ellipse_is_scored_by_the_share_that_it_holds_and_by_its_distances(show):
    page = show(guess_ellipse("Where will they stop?", CLOUD, extent=(-6, 6, -4, 4)))
    assert page.locator(".touch-dot.truth").first.get_attribute("cx").startswith("-")  # the truth is not there yet
    # The 95 % axes are 2.45 and 1.22 m; a metre is 640 / 12 px of the drawing, which starts at 1.2 and 0.6 m.
    scale = page.locator("svg").bounding_box()["width"] / 12
    drag(page, "Length and direction of your ellipse", (1.25 * scale, 0))
    drag(page, "Width of your ellipse", (0, -0.62 * scale))
    page.get_by_role("button", name="Lock it in").click()
    said = page.locator(".touch-result").inner_text()
    share, mean = int(re.search(r"holds (\d+) %", said)[1]), float(re.search(r"score of ([\d.]+), where", said)[1])
    assert 91 <= share <= 98 and 1.6 < mean < 2.4 and "an honest ellipse" in said
    assert page.locator(".touch-handle").first.is_hidden()


def test_an_ellipse_that_is_too_small_is_told_so_and_a_reload_keeps_it(show):
    page = show(guess_ellipse("Where will they all stop?", CLOUD, extent=(-6, 6, -4, 4)))
    page.get_by_role("button", name="Lock it in").click()
    said = page.locator(".touch-result").inner_text()
    assert "you were too sure." in said
    page.reload()
    assert page.locator(".touch-result").inner_text() == said
    page.get_by_role("button", name="Guess again").click()
    assert "Draw the ellipse" in page.locator(".touch-result").inner_text()


def test_a_point_is_guessed_by_keyboard_alone(show):
    page = show(guess_point("Where does it stand?", [1.0, 0.0], extent=(-6, 6, -4, 4), why="It went straight on."))
    assert page.get_by_text("It went straight on.").is_hidden()
    page.get_by_role("slider", name="Your guess").focus()
    for _ in range(11):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert "0.03 m off" in page.locator(".touch-result").inner_text()
    assert page.get_by_text("It went straight on.").is_visible()


def test_an_ellipse_beside_the_cloud_is_told_so_and_not_that_it_was_too_sure(show):
    page = show(guess_ellipse("Where did they stop?", CLOUD + np.array([4.0, 0.0]), extent=(-6, 6, -4, 4)))
    scale = page.locator("svg").bounding_box()["width"] / 12
    drag(page, "Length and direction of your ellipse", (1.25 * scale, 0))
    drag(page, "Width of your ellipse", (0, -0.62 * scale))
    page.get_by_role("button", name="Lock it in").click()
    said = page.locator(".touch-result").inner_text()
    assert "large enough, but it lies beside the cloud" in said and "too sure" not in said


def test_the_scenery_of_a_guess_may_hold_a_robot_and_words(show):
    scenery = [("robot truth", [[0, 0, 0]]), ("middle odometry", [[5, -0.8]], "5 m")]
    page = show(guess_ellipse("Where is it?", CLOUD, extent=(-6, 6, -4, 4), scenery=scenery))
    assert page.locator(".touch-robot.truth").count() == 1 and page.get_by_text("5 m", exact=True).is_visible()
