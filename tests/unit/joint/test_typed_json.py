"""Diagnostics as text: every value comes back as it was."""

import json

import numpy as np
import pytest
from value_comparison import assert_same_values

from ankleloop.joint.typed_json import dump_values, extract_arrays, load_values

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
    assert_same_values(load_values(dump_values(VALUES)), VALUES)


def test_values_survive_with_their_arrays_apart():
    arrays = {"json": np.empty(0)}
    text = dump_values(extract_arrays(VALUES, "", arrays))
    assert all(name.isidentifier() and name.isascii() and len(name) < 60 for name in arrays)
    assert {"nested_list_0_array", "nested_list_1_array", "json_"} < set(arrays)
    assert "$array" in text
    assert "0.7" not in text
    assert_same_values(load_values(text, arrays), VALUES)


def test_names_of_arrays_differ():
    arrays = {}
    extract_arrays(
        {"a b": np.ones(1), "a_b": np.zeros(1), "x" * 99: np.ones(2), "x" * 98: np.ones(3), "": np.ones(4)}, "", arrays
    )
    assert len(arrays) == 5


def test_other_programs_read_plain_json():
    assert json.loads(dump_values({"order": 2, "pole": 1j})) == {"order": 2, "pole": {"$complex": [0.0, 1.0]}}


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
    with pytest.raises(TypeError, match=message):
        dump_values(extract_arrays({"thing": value}, "", {}))
