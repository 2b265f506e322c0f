"""Guess first: locked, scored, kept, taken back."""

import pytest
from scipy.stats import chi2

from coursekit.teaching.explore import guess
from tests.browser import specimen

pytestmark = pytest.mark.browser


@pytest.fixture
def ask(page, tmp_path):
    def open_with(sigma=None):
        (tmp_path / "question.html").write_text(specimen.question(sigma), encoding="utf-8")
        page.goto((tmp_path / "question.html").as_uri())
        return page.locator(".guess")

    yield open_with
    page.evaluate("localStorage.clear()")
    assert page.complaints == []


def answer(page, *numbers):
    """By keyboard alone: into the first field, from field to field, and Enter."""
    page.get_by_label("Your guess").focus()
    for i, number in enumerate(numbers):
        if i:
            page.keyboard.press("Tab")
        page.keyboard.type(str(number))
    page.keyboard.press("Enter")


def test_the_truth_appears_after_the_guess_with_its_nees(page, ask):
    box = ask()
    assert "2.5" not in box.inner_text() and "built there" not in box.inner_text()
    answer(page, 2.1, 0.2)
    assert "The truth is 2.5 m: 0.4 m off, 2.0 your σ, a NEES of 4.00." in box.get_by_role("status").inner_text()
    assert "built there" in box.inner_text()
    assert box.get_by_role("button", name="Guess again").evaluate("(b) => b === document.activeElement")
    assert not box.get_by_role("button", name="Lock it in").is_visible()


def test_a_guess_that_is_too_sure_is_told_so(page, ask):
    box = ask()
    answer(page, 2.1, 0.05)
    assert "8.0 your σ, a NEES of 64" in box.inner_text() and "surer than you had reason to be" in box.inner_text()


def test_a_given_spread_scores_without_asking_for_one(page, ask):
    box = ask(sigma=0.1)
    assert box.get_by_role("spinbutton").count() == 1
    answer(page, 2.4)
    assert "1.0 σ, a NEES of 1.00" in box.inner_text() and "an honest guess" in box.inner_text()


@pytest.mark.parametrize(("sigma", "word"), [(0.2, "surer than"), (0.21, "an honest guess")])
def test_a_guess_is_too_sure_beyond_the_point_that_95_in_100_stay_below(page, ask, sigma, word):
    box = ask()
    answer(page, 2.1, sigma)  # off by 0.4: NEES 4.00 and 3.63
    assert f"{chi2.ppf(0.95, 1):.2f}" == "3.84" and "95 in 100 stay below 3.84" in box.inner_text()
    assert word in box.inner_text()


@pytest.mark.parametrize(("typed", "sigma", "word"), [(2.5, 100, "far less sure"), (2.1, 100, "far less sure"),
                                                      (2.5, 0.05, "an honest guess")])  # fmt: skip
def test_a_very_wide_guess_is_told_that_it_was_far_less_sure_than_it_could_be(page, ask, typed, sigma, word):
    box = ask()
    answer(page, typed, sigma)
    assert word in box.inner_text() and f"{2.5 - typed:.1g} m off" in box.inner_text()


@pytest.mark.parametrize(
    ("truth", "typed", "said"),
    [
        (191.26, "191", "You said 191 px ± 0.5 px. The truth is 191.26 px: 0.26 px off"),
        (191.26, "191.255", "You said 191.255 px ± 0.5 px. The truth is 191.26 px: 0.005 px off"),
        (0.0534123, "-0.05", "You said −0.05 px ± 0.5 px. The truth is 0.05 px: 0.1 px off"),
        (14.0, "100", "You said 100 px ± 0.5 px. The truth is 14 px: 86 px off"),
    ],
)
def test_a_guess_stands_as_typed_and_its_difference_fits_the_truth_that_is_shown(page, tmp_path, truth, typed, said):
    (tmp_path / "question.html").write_text(
        f"<!doctype html><meta charset=utf-8>{guess('Which column?', truth, unit='px')._repr_html_()}", encoding="utf-8"
    )
    page.goto((tmp_path / "question.html").as_uri())
    answer(page, typed, 0.5)
    assert said in page.locator(".guess-verdict").inner_text()
    page.evaluate("localStorage.clear()")


def test_a_guess_is_kept_in_this_browser_until_it_is_taken_back(page, ask):
    box = ask()
    answer(page, 2.1, 0.2)
    page.reload()
    assert "You said 2.1 m" in box.inner_text()
    box.get_by_role("button", name="Guess again").click()
    assert page.get_by_label("Your guess").evaluate("(i) => i === document.activeElement && i.value === ''")
    page.reload()
    assert "You said" not in box.inner_text()


@pytest.mark.parametrize("spread", ["", "0", "-1"])
def test_nothing_is_told_without_a_number_and_a_positive_spread(page, ask, spread):
    box = ask()
    answer(page, 2.1, spread)
    assert "The truth" not in box.inner_text()
