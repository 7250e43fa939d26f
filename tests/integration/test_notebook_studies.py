"""Every notebook over a setting, an option, two settings, with one or with several methods."""

import pytest
from notebook_runs import NAMES, check_notebooks

SCORES = {"keep": "scores"}
ESTIMATES = {"keep": "estimates"}
STUDIES = [
    ("lengths", "several", {}, ["table1", "table2", "comparison", "efficiency"]),
    ("two numbers", "table 1", SCORES, ["assumptions", "sweep"]),
    ("a number", "passes", ESTIMATES, ["figure4", "passes"]),
    ("the loop", "real-time", ESTIMATES, ["traces"]),
    ("a number", "selected", SCORES, ["choosing"]),
    ("null", "varying", ESTIMATES, ["time-varying"]),
    ("words", "one", SCORES, ["design", "obstacles"]),
]


def test_every_notebook_is_shown():
    assert {name for *_, notebooks in STUDIES for name in notebooks} == set(NAMES)


@pytest.mark.usefixtures("coarse_pictures")
@pytest.mark.parametrize(("points", "methods", "more", "notebooks"), STUDIES)
def test_notebooks_are_right(tmp_path, points, methods, more, notebooks):
    check_notebooks(tmp_path, points, methods, notebooks, **more)
