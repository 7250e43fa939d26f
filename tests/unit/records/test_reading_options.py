"""Options of reading: the same for `read_trial`, long records and the configuration of recordings."""

import inspect
import math

import numpy as np
import pytest

from ankleloop.records.readers import read_trial
from ankleloop.records.reading_options import ReadingOptions


def test_defaults_are_those_of_read_trial():
    parameters = inspect.signature(read_trial).parameters
    defaults = {name: p.default for name, p in parameters.items() if p.kind is p.KEYWORD_ONLY}
    assert defaults == ReadingOptions.defaults()
    assert list(defaults) == list(ReadingOptions.model_fields)


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
    ("name", "value", "message"),
    [
        ("position", 3, "position must be text, got 3"),
        ("sampling_rate", 0.0, "sampling_rate must be between 0.001 and 1e9 Hz, got 0.0"),
        ("sampling_rate", math.inf, "sampling_rate must be a finite number between 0.001 and 1e9 Hz, got inf"),
        ("position_unit", "grad", "position_unit must be one of 'rad' or 'deg'; got 'grad'"),
        ("torque_sign", 2, "torque_sign must be one of 1 or -1; got 2"),
    ],
)
def test_wrong_values_are_refused(name, value, message):
    with pytest.raises(ValueError, match=message):
        ReadingOptions.parse("the recording", **{name: value})


@pytest.mark.parametrize("names", [{"torque": "position"}, {"reference": "torque"}, {"position": "/a", "torque": "a"}])
def test_variable_of_two_channels_is_refused(names):
    with pytest.raises(ValueError, match=r"are the same variable, .*: name another one"):
        ReadingOptions.parse("trial.csv", **names)


@pytest.mark.parametrize(
    "value",
    [{"ankle_angle": "group/angle", "emg": "EMG"}, "ankle_angle=group/angle, emg = EMG"],
    ids=["mapping", "text"],
)
def test_further_variables(value):
    options = ReadingOptions.parse("trial.csv", variables=value)
    assert options.variables == {"ankle_angle": "group/angle", "emg": "EMG"}
    assert options.factor("ankle_angle") == ReadingOptions(position_unit="deg", position_sign=-1).factor("emg") == 1.0


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("angle", "variables must be pairs of a name in the trial and the variable of the file, .*; got 'angle'"),
        ("a=b, c", "got 'a=b, c'"),
        ({"a": 1}, "must be pairs"),
        (1, "must be pairs"),
        ({"torque_2": "x"}, "cannot be called 'torque_2'"),
        ({"position": "x"}, "cannot be called 'position'"),
        ({"a variable": "x"}, "cannot be called 'a variable'"),
        ({"a_variable": "x"}, "cannot be called 'a_variable'"),
    ],
)
def test_wrong_further_variables_are_refused(value, message):
    with pytest.raises(ValueError, match=message):
        ReadingOptions.parse("trial.csv", variables=value)
