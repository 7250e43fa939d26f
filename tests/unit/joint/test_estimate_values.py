"""Diagnostics as text: every value comes back as it was."""

import numpy as np
from value_comparison import assert_same_values

from ankleloop.joint.estimate_files import dump_values, load_values

VALUES = {
    "poles": np.array([0.7 + 0.1j, 0.7 - 0.1j]),
    "singular_values": np.array([3.0, 0.1 + 0.2, 1e-300, np.nan, np.inf, -0.0]),
    "pole": np.complex128(1 - 2j),
    "none_at_all": np.empty((0, 3)),
    "rank": np.int64(7),
    "stable": np.bool_(True),
    "warnings": ["σ is 2 × too large", 'a "quoted" one', None],
    "nested": {
        "history": [1.0, 2.0],
        "list": [{"array": np.ones(2)}, {"array": np.zeros(1)}],
        "empty": {},
    },
    "json": np.ones(2),
}


def test_values_survive_as_text():
    values = load_values(dump_values(VALUES))
    assert_same_values(values, VALUES)
