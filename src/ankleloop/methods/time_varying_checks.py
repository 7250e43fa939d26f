"""Whether a record can show how a joint changes: perturbation against cycle, and strength of the instruments."""

from __future__ import annotations

import numpy as np

from ankleloop.errors import DataError
from ankleloop.methods.time_varying_equations import WhitenedSystem
from ankleloop.methods.time_varying_inputs import TimeVaryingInputs

__all__ = ["check_perturbation", "free_share", "instrument_strength"]

LOCKED = 0.3  # share of the perturbation that has to differ from cycle to cycle
ROUNDS = 5


def free_share(inputs: TimeVaryingInputs) -> float:
    """Share of the power of the perturbation that does not repeat with the cycle.

    Parameters
    ----------
    inputs : TimeVaryingInputs
        Inputs of the trial.

    Returns
    -------
    float
        About 1 where the perturbation is independent of the cycle, 0 where it repeats.
    """
    since, rows = inputs.course.since, inputs.course.rows
    signal = inputs.reference
    count = np.bincount(since)
    repeated = np.zeros(signal.size)
    # The movement is a function of the phase, and a locked perturbation one of the time since the onset: each is fitted
    # to what the other leaves.
    for _ in range(ROUNDS):
        rest = signal - inputs.slow_part(signal - repeated)
        repeated[rows] = (np.bincount(since, rest[rows]) / count)[since]
    left = np.sum((rest - repeated)[rows] ** 2)
    # The mean of n independent cycles takes 1/n of their power.
    return float(left / max(np.sum(1.0 - 1.0 / count[since]), 1.0) / np.mean(signal[rows] ** 2))


def check_perturbation(inputs: TimeVaryingInputs) -> float:
    """Refuse a perturbation that repeats with the cycle.

    Parameters
    ----------
    inputs : TimeVaryingInputs
        Inputs of the trial.

    Returns
    -------
    float
        Share of the perturbation that does not repeat.

    Raises
    ------
    DataError
        If less than a third of it does not.
    """
    if not inputs.course.periodic:
        return 1.0
    share = free_share(inputs)
    if share < LOCKED:
        raise DataError(
            f"{100 * max(1.0 - share, 0.0):.0f} % of the power of {inputs.reference_name} repeats with the cycle: the "
            "perturbation is locked to it, so its effect cannot be told from the torque of the movement. Draw a new "
            "pseudorandom sequence for every cycle, independent of its phase."
        )
    return share


def instrument_strength(system: WhitenedSystem, size: int) -> float:
    """Smallest canonical correlation of instruments and regressors of the linear parameters.

    Parameters
    ----------
    system : WhitenedSystem
        The whitened system.
    size : int
        Number of linear parameters.

    Returns
    -------
    float
    """
    if system.instruments is system.regressors:
        return 1.0
    x = system.regressors[:size]
    measured, predicted, cross = x @ x.T, system.information[:size, :size], system.normal[:size, :size]
    try:
        left, right = np.linalg.cholesky(predicted), np.linalg.cholesky(measured)
    except np.linalg.LinAlgError:
        return 0.0
    matrix = np.linalg.solve(right, np.linalg.solve(left, cross).T)
    return float(np.linalg.svd(matrix, compute_uv=False)[-1])
