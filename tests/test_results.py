"""A rejection is a result that counts as false."""

import dataclasses

import pytest

from coursekit.results import Rejected


def test_a_rejection_counts_as_false_and_keeps_its_reason():
    rejected = Rejected("4 inliers, at least 12 wanted")
    assert not rejected
    assert rejected.reason == "4 inliers, at least 12 wanted"


def test_a_rejection_cannot_be_changed_and_equals_another_with_the_same_reason():
    rejected = Rejected("too dark")
    with pytest.raises(dataclasses.FrozenInstanceError):
        rejected.reason = "bright"
    assert rejected == Rejected("too dark") != Rejected("too bright")
