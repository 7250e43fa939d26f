"""Every notebook over a setting, an option, two settings, with one and with several methods: right, or refused."""

import pytest
from notebook_runs import NAMES, check_notebooks, read_accepted

SCORES = {"keep": "scores"}
ESTIMATES = {"keep": "estimates"}
STUDIES = [
    ("lengths", "several", {}),
    ("two numbers", "table 1", SCORES),
    ("a number", "passes", ESTIMATES),
    ("the loop", "real-time", ESTIMATES),
    ("a number", "selected", SCORES),
    ("null", "varying", ESTIMATES),
    ("words", "one", SCORES),
]


def test_every_notebook_is_shown():
    shown = [read_accepted(points, methods, **more) for points, methods, more in STUDIES]
    assert {name for accepted in shown for name in accepted} == set(NAMES)


@pytest.mark.usefixtures("coarse_pictures")
@pytest.mark.parametrize(("points", "methods", "more"), STUDIES)
def test_notebooks_are_right_or_refused(tmp_path, points, methods, more):
    check_notebooks(tmp_path, points, methods, **more)
