import datetime
import fcntl
import json
import os
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from workflow_runs import Run, list_differences, read_results

ROOT = Path(__file__).parents[2]
SUMMARY = ROOT / "results" / "reliability" / "faults.json"


@pytest.fixture
def finish(start):
    """Unlock a folder and run the study to its end, as the documentation says; return the results."""

    def finish(folder, *, unlock=True):
        if unlock:
            run = start(folder, "--unlock")
            assert run.wait() == 0, run.text
        run = start(folder, "--rerun-incomplete")
        assert run.wait() == 0, run.text
        return read_results(folder)

    return finish


@pytest.fixture(scope="session")
def undisturbed(repository, study_file, tmp_path_factory):
    """Results of a run that nothing disturbs, and the time that it takes [s].

    A first run compiles the kernels of the copy; the second has the same results and is measured.
    """
    results = []
    for name in ("first", "second"):
        folder = tmp_path_factory.mktemp(name)
        begin = time.monotonic()
        run = Run(repository, folder, folder.with_suffix(".log"), "--configfile", str(study_file))
        assert run.wait() == 0, run.text
        results.append(read_results(folder))
    assert not list_differences(*results)
    return results[-1], time.monotonic() - begin


@pytest.fixture(scope="session")
def unfinished(repository, study_file, undisturbed, tmp_path_factory):
    """A folder in which every trial is identified, and nothing is reported yet."""
    folder = tmp_path_factory.mktemp("unfinished")
    run = Run(repository, folder, folder.with_suffix(".log"), "--configfile", str(study_file), "--until", "identify")
    assert run.wait() == 0, run.text
    return folder


@pytest.fixture
def record(request):
    """Add counts of a test to its entry of the summary."""
    counts = {}
    request.node.stash[COUNTS] = counts
    return counts.update


COUNTS = pytest.StashKey[dict]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if report.when == "call" or (report.when == "setup" and not report.passed):
        _write_entry(item, report)
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(session, config, items):
    """Leave out of the summary what stands in it of a whole module, but is no test of it any more."""
    names = {_name(item) for item in items}
    modules = {item.path.stem for item in items}
    if not any("::" in argument for argument in config.args):
        with _open_summary() as summary:
            for name in [name for name in summary if name.partition("::")[0] in modules and name not in names]:
                del summary[name]


def _name(item):
    return f"{item.path.stem}::{item.name}"


@contextmanager
def _open_summary():
    """The file that docs/reliability.md is written from: runs of some of the tests, also at once, add to it."""
    SUMMARY.parent.mkdir(parents=True, exist_ok=True)
    with SUMMARY.with_name(f".{SUMMARY.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        summary = json.loads(SUMMARY.read_text(encoding="utf-8")) if SUMMARY.exists() else {}
        yield summary
        partial = SUMMARY.with_name(f"{SUMMARY.name}.part")
        partial.write_text(json.dumps(summary, indent=1, sort_keys=True, ensure_ascii=False) + "\n", encoding="utf-8")
        os.replace(partial, SUMMARY)


def _write_entry(item, report):
    """Outcome, date, duration and counts of the last run of a test."""
    entry = {
        "outcome": report.outcome,
        "seconds": round(report.duration, 1),
        "date": datetime.date.today().isoformat(),
        **item.stash.get(COUNTS, {}),
    }
    if report.skipped:
        entry["reason"] = str(report.longrepr[2])
    with _open_summary() as summary:
        summary[_name(item)] = entry
