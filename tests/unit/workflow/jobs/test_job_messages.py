"""A job that fails says in one line where and why; the log has the trace."""

import logging
from types import SimpleNamespace

import pytest

from ankleloop import DataError
from ankleloop.errors import describe_error, locate_errors
from ankleloop_workflow.jobs.job import running


class NotebookError(Exception):
    """An error like that of a notebook: a long report, and the error of its cell."""

    ename, evalue = "DataError", "results/scores/s/0.parquet: the table is damaged"


@pytest.fixture
def fail(tmp_path, capsys):
    """Run a job that fails; it gives the exit message and the log."""

    def fail(error, **wildcards):
        job = SimpleNamespace(log=str(tmp_path / "job.log"), wildcards=wildcards, rule="verify")
        handlers, level = logging.root.handlers[:], logging.root.level
        try:
            place = locate_errors("study s, point p, trial 3")
            with (
                pytest.raises(SystemExit) as caught,
                running(job),
                place,
            ):
                raise error
        finally:
            logging.root.handlers[:], logging.root.level = handlers, level
        assert "Traceback" not in capsys.readouterr().err
        return caught.value.code, (tmp_path / "job.log").read_text(encoding="utf-8")

    return fail


ERRORS = [
    (DataError("the record is\n too short"), "the record is too short"),
    (KeyError("delay"), "KeyError: 'delay'"),
    (ValueError(), "ValueError: no message"),
    (
        MemoryError("Unable to allocate 8. MiB"),
        "out of memory (Unable to allocate 8. MiB): run the same command again with fewer jobs at a time (--cores 1), "
        "or on a machine with more memory. What other jobs have finished is kept.",
    ),
    (NotebookError("a page\nof traces"), "results/scores/s/0.parquet: the table is damaged"),
]


@pytest.mark.parametrize(("error", "text"), ERRORS)
def test_the_message_is_one_line_with_job_and_place(fail, error, text):
    message, log = fail(error, study="s", chunk="2")
    expected = f"rule verify, study s, chunk 2; study s, point p, trial 3: {text}"
    assert message.startswith(f"{expected} (The log has all details: ")
    assert "\n" not in message
    assert expected in log.splitlines()[0]
    assert "Traceback" in log
    assert describe_error(error) == text
