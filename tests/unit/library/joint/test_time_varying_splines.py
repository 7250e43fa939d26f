"""Splines of parameters that vary, against those of SciPy."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ankleloop.joint.time_varying_course import Splines

PLACES = np.linspace(0.0, 1.0, 301)


@pytest.mark.parametrize("size", [4, 5, 12])
def test_periodic_splines_go_on_behind_the_cycle(size):
    splines = Splines(size, periodic=True)
    values = splines(PLACES)
    np.testing.assert_allclose(values.sum(axis=1), 1.0)
    np.testing.assert_allclose(values[-1], values[0], atol=1e-12)
    knots = np.arange(-3, size + 4) / size
    open_splines = BSpline.design_matrix(np.minimum(PLACES, 1 - 1e-12), knots, 3).toarray()
    folded = open_splines[:, :size].copy()
    folded[:, :3] += open_splines[:, size:]
    np.testing.assert_allclose(values, folded, atol=1e-10)
