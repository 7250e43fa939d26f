"""Whether a reference is the command that the position follows, and not a channel that was exchanged with it."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np

from ankleloop.checks.findings import Finding
from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial, once
from ankleloop.joint.regressors import Grid
from ankleloop.signals.decimation import usual_rate
from ankleloop.signals.least_squares import unexplained_share
from ankleloop.signals.responses import lag_matrix

CHANCE_DEVIATIONS = 2.0  # of the correlation of unrelated signals
COMMAND_LEADS, COMMAND_LAGS = 0.05, 0.4  # s, of a command that may explain the velocity
# Of what the lags of a command leave: leads explain less of it, those of a channel that follows explain more.
LEAD_SHARE = 0.1
COMMAND_RIDGE = 1e-4  # of the power of a lag
FILTER_LEADS, FILTER_LAGS = 0.1, 0.2  # s, of the torque or position that may explain the reference
FILTER_ROWS = 10  # for each lead or lag: a filter is one in any part of the record
FILTER_RIDGE = (
    1e-6  # of the power of a lag: there is nothing beyond the pass band of the decimation
)
SHORTEST_FILTERED = 5  # leads and lags: in a shorter record anything explains anything
FILTERED_SHARE = 0.02  # of the reference that a filter of the torque leaves, at most
BY_POSITION = 0.2  # times what the position leaves of it, at most: without noise it explains a command as well
BY_BOTH = 0.25  # times as much, at least, is left by torque and position together: a command is made of both


def find_reference_fault(
    trial: PreparedTrial, reference: str | None, delay: float = 0.04
) -> Finding | None:
    """What is wrong with the reference of a trial, if anything; computed once for all methods that take it."""
    name = reference or "reference"
    if name == "position" or name not in trial.trial:
        return None  # without the variable the method says so itself
    try:
        # At about 100 Hz an actuator of 5 … 60 Hz makes the position late enough to be seen.
        grid = trial.grid(usual_rate(trial.rate), delay)
    except DataError:  # of a very short trial the method says so itself
        return None
    exchange = find_exchange(trial, name, grid)
    if reference is None and exchange is None:
        return None
    filtered = find_filtered_torque(trial, name, grid)  # it can look early as well
    if filtered is None:
        return exchange
    return None if reference is None else filtered


@once
def find_exchange(trial: PreparedTrial, name: str, grid: Grid) -> Finding | None:
    """Whether the position follows the reference; if it is ahead of it, the two may be exchanged.

    The actuator and the load are causal: what they do to the command comes later. The sum over the cross spectrum,
    weighted by the cube of the frequency, has the sign of that lag: it is the product of the rate of the reference and
    of the acceleration. A load that is compliant at low frequencies makes the position lead there, and the sum
    negative. So the velocity decides: leads of a command explain nothing of it that its lags do not.

    Behind an actuator that is faster than the record shows (200 Hz and more) there is no lag, and nothing is said.
    """
    deviation = 1.0 / sqrt(grid.samples)
    reference = trial.channel(name, grid)
    rate = reference[2:] - reference[:-2]
    acceleration = trial.motion(grid)[2][1:-1]
    energy = (rate @ rate) * (acceleration @ acceleration)
    # Positive where the position is the later one.
    correlation = (rate @ acceleration) / sqrt(energy) if energy > 0.0 else 0.0
    if correlation > -CHANCE_DEVIATIONS * deviation:
        return None
    if not _needs_leads(reference, trial.motion(grid)[1], trial.rate / grid.factor):
        return None
    text = (
        f"the position is ahead of {name} (correlation of its acceleration with the rate of {name}: "
        f"{correlation:.2g}), but a position comes after its command. Are position and {name} exchanged, or was {name} "
        "recorded late?"
    )
    return Finding("reference", "warning", text)


def _needs_leads(reference: np.ndarray, velocity: np.ndarray, rate: float) -> bool:
    """Whether leads of a reference explain a part of the velocity that its lags leave.

    Shapes: reference, velocity (N,).
    """
    leads = round(COMMAND_LEADS * rate)
    lags = round(COMMAND_LAGS * rate)
    columns = lag_matrix(reference, leads, lags)
    target = velocity[lags : velocity.size - leads]
    by_lags = unexplained_share(columns[:, leads:], target, COMMAND_RIDGE)
    by_both = unexplained_share(columns, target, COMMAND_RIDGE)
    return by_lags - by_both > LEAD_SHARE * by_both


@once
def find_filtered_torque(trial: PreparedTrial, name: str, grid: Grid) -> Finding | None:
    """Whether the reference is a filter of the torque, which is no instrument: it has all the noise of the torque.

    Leads and lags of the torque explain a filter of it without a rest. Three cases look alike, and are told apart:

    - Of the command of a servo the torque leaves something: the voluntary torque, its noise and the reflex have no part
      in the command.
    - Without noise and reflex the torque explains the command; but so does the position, and a filter would do no harm.
    - In a load that is far more compliant than the joint, the torque is nearly the command times the impedance of the
      load. What is left is the position: command = position + compliance of the load × torque, so torque and position
      explain the command together. Nothing is left of a filter that the position could explain.

    A steep low-pass below 5 Hz responds for longer than the leads and lags: it need not be recognised.
    """
    rate = trial.rate / grid.factor
    leads = round(FILTER_LEADS * rate)
    lags = round(FILTER_LAGS * rate)
    if grid.samples < SHORTEST_FILTERED * (leads + lags + 1):
        return None
    torque = trial.channel("torque", grid)
    reference = trial.channel(name, grid)
    by_torque = _unexplained_share([torque], reference, leads, lags)
    if by_torque > FILTERED_SHARE:
        return None
    position = trial.motion(grid)[0]
    by_position = _unexplained_share([position], reference, leads, lags)
    by_both = _unexplained_share([torque, position], reference, leads, lags)
    if by_torque > BY_POSITION * by_position or by_both < BY_BOTH * by_torque:
        return None
    text = (
        f"{name} is a filter of the torque: leads and lags of the torque explain {100.0 * (1.0 - by_torque):.3g} % of "
        f"it, those of the position {100.0 * (1.0 - by_position):.3g} %. It has the noise of the torque and is no "
        "instrument: give the command of the servo as reference."
    )
    return Finding("reference", "warning", text)


def _unexplained_share(
    signals: Sequence[np.ndarray], y: np.ndarray, leads: int, lags: int
) -> float:
    """Share of the variance of a signal that leads and lags of others leave, in a part in the middle of the record."""
    taps = (leads + lags + 1) * len(signals)
    samples = min(y.size, FILTER_ROWS * taps + leads + lags)
    first = (y.size - samples) // 2
    middle = slice(first, first + samples)
    lagged = lag_matrix(np.column_stack(signals)[middle], leads, lags)
    return unexplained_share(lagged, y[middle][lags : samples - leads], FILTER_RIDGE)
