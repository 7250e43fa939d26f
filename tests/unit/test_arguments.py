"""Checks of arguments: their wording, and what counts as a number."""

import pytest

from ankleloop import options as arguments
from ankleloop.options import (
    check_memory,
)


def test_memory_beyond_the_machine_is_refused_with_the_numbers(monkeypatch):
    monkeypatch.setattr(arguments, "_find_memory", lambda: 8 * 10**9)
    check_memory("simulate", 7.9e9, "shorten duration")
    with pytest.raises(ValueError, match="would need") as refusal:
        check_memory("simulate", 3.2e12, "shorten duration")
    assert str(refusal.value) == (
        "simulate: this would need 3,200 GB of memory, and the machine has 8 GB: shorten duration."
    )
