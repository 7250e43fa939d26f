"""Options of reading: the same for `read_trial`, the command line and the configuration of recordings."""

import math

import pytest

from ankleloop.trials.reading_options import ReadingOptions


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("sign", [1, -1])
def test_factors(unit, sign):
    options = ReadingOptions(position_unit=unit, position_sign=sign, torque_sign=-sign)
    angle = sign * (math.radians(1) if unit == "deg" else 1.0)
    assert options.factor("position") == options.factor("reference") == angle
    assert options.factor("torque") == options.factor("torque_reflex") == -sign


@pytest.mark.parametrize(
    ("reference", "names"),
    [
        (None, {"position": None, "torque": "tq", "reference": None}),
        ("cmd", {"position": None, "torque": "tq", "reference": "cmd"}),
        ("none", {"position": None, "torque": "tq"}),
    ],
)
def test_names_that_are_stated_and_names_to_find(reference, names):
    options = ReadingOptions(torque="tq", reference=reference)
    assert options.names == names
    assert options.channels == {channel: name for channel, name in names.items() if name}


@pytest.mark.parametrize(
    "value",
    [{"ankle_angle": "group/angle", "emg": "EMG"}, "ankle_angle=group/angle, emg = EMG"],
    ids=["mapping", "text"],
)
def test_further_variables(value):
    options = ReadingOptions.parse("trial.csv", variables=value)
    assert options.variables == {"ankle_angle": "group/angle", "emg": "EMG"}
    assert (
        options.factor("ankle_angle")
        == ReadingOptions(position_unit="deg", position_sign=-1).factor("emg")
        == 1.0
    )
