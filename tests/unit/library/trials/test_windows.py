"""Windows that are cut out of a record."""

import numpy as np
import pytest

from ankleloop import DataError, cut, new_trial

RATE = 500.0
TIME = np.arange(5000) / RATE


@pytest.fixture
def record():
    trigger = np.zeros(TIME.size)
    kind = np.zeros(TIME.size)
    for onset, code in ((2.0, 1.0), (4.0, 0.0), (6.5, 1.0)):
        inside = (onset <= TIME) & (onset + 0.1 > TIME)
        trigger[inside] = 5.0
        kind[inside] = code
    return new_trial(np.sin(TIME), TIME.copy(), RATE, trigger=trigger, kind=kind, subject="S1")


def test_windows_have_the_times_of_the_record_and_say_where_the_onset_is(record):
    windows = cut(record, [2.0, 4.0], condition=["up", 3.0], window=(-0.2, 0.3))
    assert [part.attrs["condition"] for part in windows] == ["up", "3"]
    for part, onset in zip(windows, (2.0, 4.0), strict=True):
        times = part["time"].values
        assert times[0] == pytest.approx(onset - 0.4)
        assert times[-1] == pytest.approx(onset + 0.5 - 1.0 / RATE)
        assert times[0] + part.attrs["onset"] == pytest.approx(onset)
        np.testing.assert_array_equal(part["torque"], times)
        assert (part.attrs["subject"], part.attrs["window_end"]) == ("S1", 0.3)


def test_a_trigger_and_a_variable_say_the_same_as_numbers(record):
    by_name = cut(record, "trigger", condition="kind")
    by_number = cut(record, [2.0, 4.0, 6.5], condition=[1, 0, 1])
    assert all(one.identical(other) for one, other in zip(by_name, by_number, strict=True))


@pytest.mark.parametrize(
    ("onsets", "options", "message"),
    [
        ([0.1, 4.0], {}, "onset 1 of 2, at 0.1 s, is too near"),
        ([4.0, 9.9], {}, "onset 2 of 2"),
        ([2000.0, 4000.0], {}, "seconds of the record"),
        ([4.0, 4.2], {}, "windows of the onsets at 4 and 4.2 s overlap"),
        ([4.0], {}, "1 onsets and 2 conditions"),
        ([2.0, 4.0], {"window": (0.1, 0.2)}, "must begin before the onset"),
        ("press", {}, "no variable 'press' for onsets"),
        ("trigger", {"condition": "side"}, "no variable 'side' for condition"),
    ],
)
def test_windows_that_cannot_be_cut_are_refused(record, onsets, options, message):
    with pytest.raises(DataError, match=message):
        cut(record, onsets, **{"condition": ["a", "b"], **options})


def test_a_variable_that_never_rises_has_no_onsets(record):
    flat = record.assign(trigger=0.0 * record["trigger"])
    with pytest.raises(DataError, match="never rises"):
        cut(flat, "trigger", condition="kind")
