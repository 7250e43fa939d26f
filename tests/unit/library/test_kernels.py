"""Compiled code in files that several processes write, damage or may not write."""

import importlib.util
import sys

import numpy as np
import pytest

SOURCE = """
from ankleloop.kernels import kernel

@kernel()
def total(values):
    result = values[0]
    for value in values[1:]:
        result += value
    return result
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Load the module as a new process does; its compiled code lies in a folder of its own."""
    path = tmp_path / "module.py"
    path.write_text(SOURCE)
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path / "cache"))

    def load(source=SOURCE):
        path.write_text(source)
        spec = importlib.util.spec_from_file_location("module", path)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "module", module)
        spec.loader.exec_module(module)
        return module.total

    return load


def files(tmp_path, pattern="*"):
    return sorted(path for path in (tmp_path / "cache").rglob(pattern) if path.is_file())


def hits(total):
    return sum(total.stats.cache_hits.values())


def test_processes_that_compile_at_once_for_other_types_never_take_code_of_each_other(
    load, tmp_path, monkeypatch
):
    """Both read the empty index; then one writes all, and then the other."""
    whole, real = np.arange(5), np.arange(5.0)
    first, second = load(), load()
    cache_file = first._cache._cache_file
    read = cache_file._load_index

    def read_then_wait():
        names = read()
        assert second(real) == 10.0
        return names

    monkeypatch.setattr(cache_file, "_load_index", read_then_wait)
    # The index is read before compiling, to look for the code, and before writing.
    monkeypatch.setattr(first._cache, "load_overload", lambda signature, target: None)
    assert first(whole) == 10
    assert len(files(tmp_path, "*.nbc")) == 2
    for values in (whole, real, whole):
        result = load()(values)
        assert result == 10
        assert isinstance(result, type(values[0].item()))
    total = load()
    assert total(whole) == 10
    assert total(real) == 10.0
    assert hits(total) == 2


def test_damaged_files_are_compiled_anew_and_replaced(load, tmp_path):
    values = np.arange(5.0)
    load()(values)
    for path in files(tmp_path):
        content = path.read_bytes()
        for damaged in (b"", content[: len(content) // 2], b"other bytes"):
            path.write_bytes(damaged)
            assert load()(values) == 10.0
            total = load()
            assert total(values) == 10.0
            assert hits(total) == 1, path.suffix


def test_without_space_the_function_still_runs(load, tmp_path, monkeypatch):
    total = load()

    def fail(path):
        raise OSError(28, "No space left on device", path)

    monkeypatch.setattr(total._cache._cache_file, "_open_for_write", fail)
    assert total(np.arange(5.0)) == 10.0
    assert not files(tmp_path)
