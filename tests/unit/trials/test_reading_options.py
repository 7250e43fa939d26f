"""Options of reading: the same for `read_trial`, long records and the configuration of recordings."""

import math

import numpy as np
import pytest

from ankleloop.trials.reading_options import ReadingOptions


def test_channels():
    assert ReadingOptions(position="angle").channels == {"position": "angle", "torque": "torque"}
    assert ReadingOptions(reference="command").channels["reference"] == "command"


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("sign", [1, -1])
def test_factors(unit, sign):
    options = ReadingOptions(position_unit=unit, position_sign=sign, torque_sign=-sign)
    angle = sign * (math.radians(1) if unit == "deg" else 1.0)
    assert options.factor("position") == options.factor("reference") == angle
    assert options.factor("torque") == options.factor("torque_reflex") == -sign


@pytest.mark.parametrize("sign", [-1, -1.0, np.int8(-1), np.float32(-1)])
def test_signs_become_integers(sign):
    options = ReadingOptions(position_sign=sign, torque_sign=sign)
    assert (options.position_sign, options.torque_sign) == (-1, -1)
    assert type(options.position_sign) is type(options.torque_sign) is int


@pytest.mark.parametrize(
    "value",
    [{"ankle_angle": "group/angle", "emg": "EMG"}, "ankle_angle=group/angle, emg = EMG"],
    ids=["mapping", "text"],
)
def test_further_variables(value):
    options = ReadingOptions.parse("trial.csv", variables=value)
    assert options.variables == {"ankle_angle": "group/angle", "emg": "EMG"}
    assert options.factor("ankle_angle") == ReadingOptions(position_unit="deg", position_sign=-1).factor("emg") == 1.0
