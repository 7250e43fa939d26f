"""Groups of variables in a file: both containers give back what was written."""

import numpy as np
import pytest
import xarray as xr

from ankleloop.trials.group_files import read_groups, write_groups

NUMBERS = {
    "scalar": ((), 0.1 + 0.2),
    "count": ((), 3),
    "vector": ("n", np.array([1.0, -0.0, 5e-324])),
    "single": ("one", np.array([2.5])),
    "nothing": ("none", np.empty(0)),
    "matrix": (("n", "m"), np.arange(6.0).reshape(3, 2)),
    "row": (("one", "m"), np.array([[1.0, 2.0]])),
    "integers": ("n", np.array([1, 2, 300])),
}


@pytest.fixture(params=[".nc", ".mat"])
def path(request, tmp_path):
    return tmp_path / f"file{request.param}"


def test_numbers_and_texts_come_back(path):
    texts = {"text": "σ · 'quoted'\nline", "empty": "", "number": 2.0}
    data = xr.Dataset(NUMBERS | {"long": ((), "x" * 70_000)}, {"name": ["a", "bc"]}, texts)
    write_groups(
        {"": xr.Dataset(attrs={"kind": "test"}), "data": data, "bare": xr.Dataset()},
        path,
        "contents",
    )
    groups = read_groups(path, "contents")
    assert groups[""].text("kind") == "test"
    for name in ("text", "empty"):
        assert groups["data"].text(name) == texts[name]
    assert groups["data"].text("long") == "x" * 70_000
    assert groups["data"].number("number") == 2.0
    for name, (_, values) in NUMBERS.items():
        read = groups["data"].array(name, *np.shape(values))
        assert read.tobytes() == np.asarray(values, dtype=float).tobytes(), name
