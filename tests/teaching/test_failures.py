"""Every failure is caught by its check, and the check lets the sound version through."""

import pytest

from coursekit.teaching.failures import Failure, gallery

GALLERY = gallery()


@pytest.mark.parametrize("name", GALLERY)
def test_the_check_catches_the_failure(name):
    failure = GALLERY[name]
    assert not failure.check(failure.wrong)


@pytest.mark.parametrize("name", GALLERY)
def test_the_check_passes_the_sound_version(name):
    failure = GALLERY[name]
    assert failure.check(failure.right)


@pytest.mark.parametrize("name", GALLERY)
def test_a_failure_says_where_it_comes_from_and_what_it_teaches(name):
    failure = GALLERY[name]
    assert name.split(".")[0] in failure.check.__module__
    assert failure.source.strip()
    assert failure.lesson.strip().endswith(".")


def test_two_failures_cannot_share_a_name(monkeypatch):
    monkeypatch.setattr("coursekit.teaching.failures._gallery", {})
    parts = {"source": "here", "wrong": abs, "right": abs, "check": lambda f: True, "lesson": "None."}
    Failure("lab99.twice", **parts)
    with pytest.raises(ValueError, match="two failures"):
        Failure("lab99.twice", **parts)
