"""Comparison of estimates and of diagnostics that tests of several files use."""

import numpy as np
import xarray as xr

from ankleloop.joint.models import model_dataset
from ankleloop.joint.regressors import TORQUES


def assert_same_values(loaded, saved):
    """Diagnostics of a file: the same keys, values, arrays with their types; tuples may have become lists."""
    if isinstance(saved, dict):
        assert list(loaded) == list(saved)
        for name in saved:
            assert_same_values(loaded[name], saved[name])
    elif isinstance(saved, list | tuple):
        assert isinstance(loaded, list)
        assert len(loaded) == len(saved)
        for after, before in zip(loaded, saved, strict=True):
            assert_same_values(after, before)
    elif isinstance(saved, np.ndarray):
        assert (loaded.dtype, loaded.shape) == (saved.dtype, saved.shape)
        np.testing.assert_array_equal(loaded, saved)
        if saved.dtype.kind == "f":
            np.testing.assert_array_equal(
                np.signbit(loaded)[~np.isnan(saved)], np.signbit(saved)[~np.isnan(saved)]
            )
    else:
        value = saved.item() if isinstance(saved, np.generic) else saved
        assert type(loaded) is type(value)
        assert repr(loaded) == repr(value)  # nan is nan, and -0.0 is not 0.0


def assert_same_estimate(loaded, saved):
    """Everything of an estimate, bit by bit."""
    assert repr(loaded) == repr(saved)
    assert loaded.torque.identical(saved.torque[list(loaded.torque)])
    for name in ("time", *TORQUES):
        assert loaded.torque[name].values.tobytes() == saved.torque[name].values.tobytes()
    for name in ("method", "stiffness", "reflex", "diagnostics"):
        assert_same_values(getattr(loaded, name), getattr(saved, name))
    assert_same_values(
        *({name: list(ends) for name, ends in each.intervals.items()} for each in (loaded, saved))
    )
    assert (loaded.predictor is None) == (saved.predictor is None)
    if saved.predictor is not None:
        xr.testing.assert_identical(model_dataset(loaded.predictor), model_dataset(saved.predictor))
