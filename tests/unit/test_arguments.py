"""Checks of arguments: their wording, and what counts as a number."""

import numpy as np
import pytest

from ankleloop import options as arguments
from ankleloop.options import (
    as_plain,
    check_memory,
    describe_limits,
    show_value,
)


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({}, ""),
        ({"ge": 0, "le": 1}, "between 0 and 1 s"),
        ({"gt": 0, "le": 1e6}, "above 0 and at most 1e6 s"),
        ({"ge": 0, "lt": 1}, "at least 0 and below 1 s"),
        ({"ge": 1e-9}, "at least 1e-9 s"),
        ({"le": 100000}, "at most 100000 s"),
        ({"ge": -100.5, "le": 1e100}, "between -100.5 and 1e100 s"),
    ],
)
def test_limits_in_words(limits, words):
    assert describe_limits("s", **limits) == words
    assert describe_limits(**limits) == words.removesuffix(" s")


def test_a_long_value_is_cut():
    for value in (np.zeros(10**6), list(range(10**6)), "x" * 10**6, 10**4000):
        assert len(show_value(value)) < 120
    assert show_value("no") == "'no'"
    assert as_plain("no") == "no"


def test_memory_beyond_the_machine_is_refused_with_the_numbers(monkeypatch):
    monkeypatch.setattr(arguments, "_find_memory", lambda: 8 * 10**9)
    check_memory("simulate", 7.9e9, "shorten duration")
    with pytest.raises(ValueError, match="would need") as refusal:
        check_memory("simulate", 3.2e12, "shorten duration")
    assert str(refusal.value) == (
        "simulate: this would need 3,200 GB of memory, and the machine has 8 GB: shorten duration."
    )
