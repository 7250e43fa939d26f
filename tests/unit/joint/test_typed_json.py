"""Diagnostics as text: every value comes back as it was."""

import numpy as np
import pytest
from value_comparison import assert_same_values

from ankleloop.errors import DataError
from ankleloop.joint.estimate_files import dump_values, load_values

VALUES = {
    "poles": np.array([0.7 + 0.1j, 0.7 - 0.1j]),
    "real_poles": np.array([0.5, 0.25]),
    "single": np.array([1j], dtype=np.complex64),
    "singular_values": np.array([3.0, 0.1 + 0.2, 1e-300, np.nan, np.inf, -0.0]),
    "pole": np.complex128(1 - 2j),
    "matrix": np.arange(4).reshape(2, 2),
    "complex_matrix": np.array([[1j], [2.0]]),
    "mask": np.array([True, False]),
    "counts": np.array([1, 2], dtype=np.uint8),
    "scalar": np.array(2.5),
    "none_at_all": np.empty((0, 3)),
    "ends": np.array([np.iinfo(np.uint64).max, 0], dtype=np.uint64),
    "half": np.array([[np.nan], [np.finfo(np.float16).max]], dtype=np.float16),
    "rank": np.int64(7),
    "stable": np.bool_(True),
    "unstable": False,
    "condition": np.float32(0.5),
    "infinite": float("inf"),
    "passes": 3,
    "none": None,
    "warnings": ["σ is 2 × too large", 'a "quoted" one'],
    "nested": {"history": [1.0, 2.0], "list": [{"array": np.ones(2)}, {"array": np.zeros(1)}], "empty": {}},
    "json": np.ones(2),
}


def test_values_survive_as_text():
    values = load_values(dump_values(VALUES), "file")
    assert_same_values(values, VALUES)
    assert values["matrix"].flags.writeable


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (object(), "object cannot be kept in diagnostics"),
        (np.array(["text"]), "an array of type <U4 cannot be kept in diagnostics"),
        (np.array([None]), "an array of type object cannot be kept in diagnostics"),
    ],
)
def test_values_without_a_form_are_refused(value, message):
    with pytest.raises(TypeError, match=message):
        dump_values({"thing": value})


@pytest.mark.parametrize(
    "text",
    [
        "",
        '{"$array": [1.0, "x"], "dtype": "float64", "shape": [2]}',
        '{"$array": [1.0], "dtype": "float65", "shape": [1]}',
        '{"$array": [1.0], "dtype": "float64", "shape": [2]}',
        '{"$array": [1.0], "dtype": "float64", "shape": "long"}',
        '{"$array": [[1.0], [1.0, 2.0]]}',
        '{"$array": "curve"}',
        '{"$array": ["x"], "dtype": "object"}',
        '{"$complex": [1.0, 2.0, 3.0]}',
        '{"$complex": 1.0}',
        "[" * 100_000,
    ],
)
def test_damaged_text_is_refused(text):
    with pytest.raises(DataError, match=r"file: the values cannot be read .*: the file is damaged"):
        load_values(text, "file")
