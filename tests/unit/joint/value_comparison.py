"""Comparison of diagnostics that tests of several files use."""

import numpy as np


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
    else:
        value = saved.item() if isinstance(saved, np.generic) else saved
        assert type(loaded) is type(value)
        assert loaded == value or (value != value and loaded != loaded)
