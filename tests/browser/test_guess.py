"""Guess first: locked, scored, kept, taken back."""

import pytest

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
    assert "The truth is 2.5 m: 0.4 m off, 2.0 your σ, a NEES of 4.0." in box.get_by_role("status").inner_text()
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
    assert "1.0 σ, a NEES of 1.0" in box.inner_text() and "an honest guess" in box.inner_text()


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
