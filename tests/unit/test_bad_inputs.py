"""Whatever comes, a clear error or a right number: every row of the table of bad inputs."""

from collections import Counter

import pytest
from bad_inputs import read_table
from bad_inputs.bad_input import BadInput

import ankleloop

TABLE = read_table()
ROWS = [
    pytest.param(row, id=f"{subject}: {row.wrong}".replace("::", ":"))
    for subject, (_, rows) in TABLE.items()
    for row in rows
]


@pytest.mark.parametrize("row", ROWS)
def test_bad_input(row, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a relative path that is written by mistake lands there as well
    row.check(tmp_path)


def test_every_row_has_a_name_of_its_own():
    for _, rows in TABLE.values():
        assert [name for name, count in Counter(row.wrong for row in rows).items() if count > 1] == []


def test_every_public_function_has_a_row():
    """Classes that nobody calls, and the registry, are no functions."""
    functions = {name for name in ankleloop.__all__ if callable(getattr(ankleloop, name))}
    functions -= {"DataError", "UnstableLoopError", "Estimate"}
    called = {row.function.partition("(")[0].partition(".")[0] for _, rows in TABLE.values() for row in rows}
    assert functions | {"subspace"} <= called


def test_a_row_fails_where_the_library_does_something_else(tmp_path):
    """The table itself can fail: no error, another class, another message, a file that is written."""

    def refuse(_):
        raise ValueError("the rate must be above 0 Hz")

    def write(_):
        (tmp_path / "partial").touch()
        refuse(_)

    def check(call, *says, **outcome):
        BadInput("a row", lambda folder: None, call, says, **{"error": ValueError, **outcome}).check(tmp_path)

    check(refuse, "above 0 Hz")
    with pytest.raises(pytest.fail.Exception):
        check(lambda _: None)
    for call, text, outcome in [
        (refuse, "below 0 Hz", {}),
        (refuse, "above", {"error": Exception}),
        (lambda _: [], "", {"error": None}),
        (lambda _: ["a spike"], "a step", {"error": None}),
        (write, "above", {}),
    ]:
        with pytest.raises(AssertionError):
            check(call, text, **outcome)
