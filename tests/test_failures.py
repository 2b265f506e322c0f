"""Every exhibit is caught by its check, and the check lets the sound version through."""

import pytest

from coursekit.failures import Exhibit, gallery

GALLERY = gallery()


@pytest.mark.parametrize("name", GALLERY)
def test_the_check_catches_the_exhibit(name):
    exhibit = GALLERY[name]
    assert not exhibit.check(exhibit.wrong)


@pytest.mark.parametrize("name", GALLERY)
def test_the_check_passes_the_sound_version(name):
    exhibit = GALLERY[name]
    assert exhibit.check(exhibit.right)


@pytest.mark.parametrize("name", GALLERY)
def test_an_exhibit_says_where_it_comes_from_and_what_it_teaches(name):
    exhibit = GALLERY[name]
    assert name.split(".")[0] in exhibit.check.__module__
    assert exhibit.source.strip()
    assert exhibit.lesson.strip().endswith(".")


def test_two_exhibits_cannot_share_a_name(monkeypatch):
    monkeypatch.setattr("coursekit.failures._gallery", {})
    parts = {"source": "here", "wrong": abs, "right": abs, "check": lambda f: True, "lesson": "None."}
    Exhibit("lab99.twice", **parts)
    with pytest.raises(ValueError, match="two exhibits"):
        Exhibit("lab99.twice", **parts)
