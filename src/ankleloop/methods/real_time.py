"""The real-time algorithm: one pass, recursive in time, for perturbations that decorrelate the two paths."""

from __future__ import annotations

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.models import sum_paths
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import MOTION
from ankleloop.methods.method import (
    KnownDelayOptions,
    Method,
    RectifierOptions,
    Validity,
)
from ankleloop.options import option
from ankleloop.quantities import STIFFNESS
from ankleloop.signals.responses import lag_matrix

UPDATE_RATE = 10.0  # Hz at which parameters are solved for and traced
SHORTEST_LEVEL = 1.0  # s over which position and torque are averaged, at least
RIDGE = 1e-9  # of the mean information: it only keeps directions solvable that nothing has excited


class RealTimeOptions(KnownDelayOptions, RectifierOptions):
    """Options of the real-time algorithm."""

    memory: float = option(10.0, "time constant of forgetting", unit="s", ge=0.1, le=1e6)
    settling: float | None = option(
        None,
        "time until the parameters count; null for the memory",
        unit="s",
        ge=SHORTEST_LEVEL,
        le=1e6,
    )
    reflex_lags: float = option(
        0.4, "length of the reflex impulse response", unit="s", ge=0.001, le=5
    )


def identify_real_time(trial: PreparedTrial, options: RealTimeOptions) -> Estimate:
    r"""Track intrinsic and reflex stiffness by the real-time algorithm.

    It follows the idea of Ludvig and Kearney (2006): a perturbation whose intrinsic inputs are uncorrelated with the
    reflex torque allows to estimate each path by itself, in one pass, while the other path acts as noise. Their details
    are not published; the choices here are recursive least squares with exponential forgetting,

    .. math:: R(t) = \lambda R(t-1) + \varphi(t) \varphi(t)^T, \quad r(t) = \lambda r(t-1) + \varphi(t) e(t), \quad
              \hat\theta(t) = R(t)^{-1} r(t), \quad \lambda = e^{-1 / (memory \cdot rate)},

    first with φ = [P, Ṗ, P̈, 1] and e the measured torque, which gives K, B and I; then with φ = [lags of the delayed,
    rectified velocity, 1] and e what the intrinsic path leaves. Parameters are renewed ten times a second, and only
    from the past: every torque is a prediction by parameters that were known at the time. The settling time alone is
    predicted in hindsight, by the first parameters that count. Position and torque are taken from their means over
    the settling time (its first second, at least), so constants added to them change nothing.

    It is a correlation method for open loop. With a PRBS, whose intrinsic and reflex responses are correlated, or in
    closed loop, it is biased.

    Parameters
    ----------
    trial : PreparedTrial
        A reference is not used. ``simulate(perturbation="pulses")`` has a perturbation that decorrelates.
    options : RealTimeOptions

    Returns
    -------
    Estimate
        K, B, I and G are means of their traces; `diagnostics` holds the traces: "trace_time" [s], "trace_K",
        "trace_B", "trace_I", "trace_G". `model` is None.

    References
    ----------
    D. Ludvig and R. E. Kearney, "Real-time estimation of intrinsic and reflex stiffness", Proc. IEEE EMBS 28, 292-295,
    2006.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = simulate(seed=1, duration=40.0, perturbation="pulses", switching_interval=0.2, closed_loop=False)
    >>> estimate = identify(trial, "real-time")
    >>> bool(abs(estimate.stiffness["K"] / 150 - 1) < 0.1)
    True
    """
    settling = options.memory if options.settling is None else options.settling
    regressors = trial.regressors(
        delay=options.delay,
        basis="rectifier",
        identification_rate=options.identification_rate,
    )
    rate = regressors.rate
    first = round(settling * rate)
    samples = regressors.torque.size
    if samples < first + 2 * rate:
        raise DataError(
            f"the record of {samples / rate:.3g} s is too short for {settling:g} s of settling: record longer."
        )
    chunk = max(1, round(rate / UPDATE_RATE))
    forgetting = float(np.exp(-1.0 / (options.memory * rate)))
    # The operating point is that of the settling time: later samples are not known when the parameters begin to count.
    known = slice(0, max(first, round(SHORTEST_LEVEL * rate)))
    torque = regressors.torque - regressors.torque[known].mean()
    motion = regressors.inputs[:, :MOTION].copy()
    motion[:, 0] -= motion[known, 0].mean()
    intrinsic, stiffness = _track(motion, torque, forgetting, chunk, first)
    drive = regressors.inputs[:, -1]
    longest = round(options.reflex_lags * rate)
    earlier = np.full(longest, drive[0])  # before the record it has its first value
    lagged = lag_matrix(np.concatenate((earlier, drive)), 0, longest)
    reflex, responses = _track(lagged, torque - intrinsic, forgetting, chunk, first)
    traces = dict(zip(STIFFNESS, stiffness.T, strict=True))
    traces["G"] = responses.sum(axis=1)
    time = regressors.time[::chunk]
    counts = time >= regressors.time[first]
    means = {name: float(trace[counts].mean()) for name, trace in traces.items()}
    diagnostics = {"settling": settling, "trace_time": time}
    diagnostics |= {f"trace_{name}": trace for name, trace in traces.items()}
    gain = means.pop("G")
    return Estimate(
        method="real-time",
        torque=sum_paths(regressors.time, rate, intrinsic, reflex),
        stiffness=means,
        reflex={"delay": options.delay, "G": gain},
        diagnostics=diagnostics,
    )


def _track(
    inputs: np.ndarray, target: np.ndarray, forgetting: float, chunk: int, settling: int
) -> tuple[np.ndarray, np.ndarray]:
    """Predictions from the past, and the parameters that were known when each chunk of samples began.

    The recursion is on the information matrix: it is exact, and stays bounded where the perturbation is quiet.
    """
    scale = inputs.std(axis=0)
    scale[scale == 0] = 1.0
    regressors = np.column_stack([inputs / scale, np.ones(target.size)])
    unknowns = regressors.shape[1]
    information = np.zeros((unknowns, unknowns))
    projection = np.zeros(unknowns)
    theta = np.zeros(unknowns)
    prediction = np.empty(target.size)
    starts = range(0, target.size, chunk)
    parameters = np.empty((len(starts), unknowns - 1))
    for k, start in enumerate(starts):
        rows = slice(start, start + chunk)
        part = regressors[rows]
        parameters[k] = theta[:-1] / scale
        prediction[rows] = part[:, :-1] @ theta[:-1]
        decay = forgetting ** len(part)
        weighted = part.T * forgetting ** np.arange(len(part))[::-1]
        information = decay * information + weighted @ part
        projection = decay * projection + weighted @ target[rows]
        ridge = RIDGE * np.trace(information) / unknowns
        theta = np.linalg.solve(information + ridge * np.eye(unknowns), projection)
    first = -(-settling // chunk)
    hindsight = slice(0, first * chunk)
    prediction[hindsight] = inputs[hindsight] @ parameters[first]
    return prediction, parameters


METHODS = (
    Method("real-time", RealTimeOptions, identify_real_time, validity=Validity(one_pass={})),
)
