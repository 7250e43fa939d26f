"""Every notebook over points of every kind: right, or refused."""

import pytest
from notebook_runs import METHODS, POINTS, check_notebooks, read_accepted


@pytest.mark.usefixtures("coarse_pictures")
@pytest.mark.parametrize("methods", METHODS)
@pytest.mark.parametrize("points", POINTS)
def test_notebooks_are_right_or_refused(tmp_path, points, methods):
    if not read_accepted(points, methods):
        pytest.skip("no notebook accepts it")
    check_notebooks(tmp_path, points, methods)
