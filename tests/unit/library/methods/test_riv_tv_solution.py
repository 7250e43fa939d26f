"""The solution of `riv-tv`: its covariance, and the strength of its instruments."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from ankleloop import simulate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.riv.equations import Parameters
from ankleloop.methods.riv_tv.equations import TimeVaryingEquations, WhitenedSystem
from ankleloop.methods.riv_tv.options import RivTvOptions
from ankleloop.methods.riv_tv.solution import solve_time_varying

CYCLES = {"variation": "cycle", "duration": 31.0, "stiffness_variation": 0.4, "movement": 0.1}


@pytest.fixture(scope="module")
def solution():
    trial = simulate(seed=3, snr_db=30.0, **CYCLES)
    options = RivTvOptions(cycle_onsets="phase")
    return solve_time_varying(TimeVaryingEquations([prepare(trial)], options))


def test_the_covariance_of_a_mean_is_that_of_the_means_of_cycles(solution):
    """One unknown, a constant: its variance is that of n means over n, times what estimated weights add.

    The variance of a smoothed periodogram over its square is that of white noise by a random generator.
    """
    rng = np.random.default_rng(1)
    equations = solution.equations
    course = equations.course
    means = rng.standard_normal(course.segments)
    torque = means[course.segment]
    constant = np.ones((1, torque.size))
    mean = replace(
        solution,
        parameters=Parameters(np.array([torque.mean()]), solution.parameters.dynamics),
        system=WhitenedSystem(constant, constant, torque),
        penalty=np.zeros((1, 1)),
    )
    spectra = np.array(
        [equations.noise.spectrum(rng.standard_normal(torque.size)) for _ in range(600)]
    )
    relative = np.mean(np.var(spectra, axis=0) / np.mean(spectra, axis=0) ** 2)
    expected = np.var(means, ddof=1) / means.size * (1.0 + 2.0 * relative)
    assert mean.covariance.item() == pytest.approx(expected, rel=0.008)
    assert relative > 0.02  # or the last factor would not be seen


def test_the_strength_of_instruments_is_the_f_of_the_worst_regressor(solution):
    """By a generalised eigenvalue problem, and an ordinary regression of the direction that it gives."""
    size = solution.equations.bases.size
    instruments, regressors = solution.system.instruments[:size], solution.system.regressors[:size]
    cross = regressors @ instruments.T
    explained = cross @ np.linalg.solve(instruments @ instruments.T, cross.T)
    _, directions = linalg.eigh(explained, regressors @ regressors.T)
    worst = directions[:, 0] @ regressors
    coefficients = np.linalg.lstsq(instruments.T, worst, rcond=None)[0]
    residual = worst - coefficients @ instruments
    frequency = np.fft.rfftfreq(worst.size, 0.01)
    band = np.mean((frequency >= 0.05) & (frequency <= 38.0))
    independent = band * worst.size
    numerator = (np.sum(worst**2) - np.sum(residual**2)) / size
    f = numerator / (np.sum(residual**2) / (independent - size))
    assert solution.weakness_f == pytest.approx(f, rel=0.01)
