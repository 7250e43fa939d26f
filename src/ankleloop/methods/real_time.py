"""The real-time algorithm: one pass, recursive in time, for perturbations that decorrelate the two paths."""

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate, torque_dataset
from ankleloop.joint.regressors import INTRINSIC_NAMES, build_regressors

__all__ = ["identify_real_time"]

UPDATE_RATE = 10.0  # Hz: parameters are solved for, and traces kept, so often
RIDGE = 1e-9  # of the mean information: it only keeps directions solvable that nothing has excited


def identify_real_time(
    trial,
    *,
    delay=0.04,
    basis=None,
    identification_rate=100.0,
    memory=10.0,
    settling=None,
    reflex_lags=0.4,
):
    r"""Track intrinsic and reflex stiffness by the real-time algorithm.

    It follows the idea of Ludvig and Kearney (2006): a perturbation whose intrinsic inputs are uncorrelated with the
    reflex torque lets each path be found by itself, in one pass, the other one being noise to it. Their details are not
    published; the choices here are recursive least squares with exponential forgetting,

    .. math:: R(t) = \lambda R(t-1) + \varphi(t) \varphi(t)^T, \quad r(t) = \lambda r(t-1) + \varphi(t) e(t), \quad
              \hat\theta(t) = R(t)^{-1} r(t), \quad \lambda = e^{-1 / (memory \cdot rate)},

    first with φ = [P, Ṗ, P̈, 1] and e the measured torque, which gives K, B and I; then with φ = [lags of the delayed,
    rectified velocity, 1] and e what the intrinsic path leaves. Parameters are renewed ten times a second, and only
    from the past: every torque is a prediction by parameters that were known at the time. The settling time alone is
    predicted in hindsight, by the first parameters that count.

    It is a correlation method for open loop. With a PRBS, whose intrinsic and reflex responses are correlated, or in
    closed loop, it is biased.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial; a reference is not used. ``simulate(perturbation="pulses")`` has a perturbation that decorrelates.
    delay : float
        Reflex delay [s].
    basis : {"rectifier"}, optional
        Static nonlinearity; the method has one input for the reflex path, the half-wave rectified velocity.
    identification_rate : float
        Rate of the identification [Hz].
    memory : float
        Time constant of forgetting [s].
    settling : float, optional
        Time until the parameters count [s]; `memory` by default. Means of the traces start there.
    reflex_lags : float
        Length of the reflex impulse response [s].

    Returns
    -------
    Estimate
        K, B, I and G are means of their traces; `diagnostics` holds the traces: "trace_time" [s], "trace_K",
        "trace_B", "trace_I", "trace_G". `model` is None.

    Raises
    ------
    DataError
        If the record is unusable, or not longer than the settling time and two seconds.
    ValueError
        For an option out of its range.

    References
    ----------
    D. Ludvig and R. E. Kearney, "Real-time estimation of intrinsic and reflex stiffness", Proc. IEEE EMBS 28, 292-295,
    2006.

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> trial = simulate(seed=1, duration=40.0, perturbation="pulses", switching_interval=0.2, closed_loop=False)
    >>> estimate = identify_real_time(trial)
    >>> bool(abs(estimate.stiffness["K"] / 150 - 1) < 0.1)
    True
    """
    if basis not in (None, "rectifier"):
        raise ValueError(f"the real-time algorithm has one reflex input: basis must be 'rectifier', got {basis!r}.")
    settling = memory if settling is None else settling
    for name, value, unit in (("memory", memory, "s"), ("reflex_lags", reflex_lags, "s")):
        if not value > 0:
            raise ValueError(f"{name} must be positive, got {value!r} {unit}.")
    if settling < 0:
        raise ValueError(f"settling must not be negative, got {settling!r} s.")
    regressors = build_regressors(
        trial, delay=delay, basis="rectifier", degree=1, identification_rate=identification_rate
    )
    rate, torque = regressors.rate, regressors.torque
    first = round(settling * rate)
    if torque.size < first + 2 * rate:
        raise DataError(
            f"the record of {torque.size / rate:.3g} s is too short for a settling time of {settling:g} s: record at "
            "least two seconds more than that, or shorten memory or settling."
        )
    block = max(1, round(rate / UPDATE_RATE))
    forgetting = np.exp(-1.0 / (memory * rate))
    motion = regressors.inputs[:, : len(INTRINSIC_NAMES)]
    intrinsic, stiffness = _track(motion, torque, forgetting, block, first)
    lagged = _lags(regressors.inputs[:, -1], round(reflex_lags * rate))
    reflex, responses = _track(lagged, torque - intrinsic, forgetting, block, first)
    torques = {"intrinsic": intrinsic - intrinsic.mean(), "reflex": reflex - reflex.mean()}
    traces = dict(zip(("K", "B", "I", "G"), [*stiffness.T, responses.sum(axis=1)], strict=True))
    time = regressors.time[::block]
    means = {name: float(trace[time >= regressors.time[first]].mean()) for name, trace in traces.items()}
    return Estimate(
        method="real-time",
        torque=torque_dataset(regressors.time, rate, net=torques["intrinsic"] + torques["reflex"], **torques),
        matrices=None,
        stiffness={name: means[name] for name in "KBI"},
        reflex={"delay": float(delay), "G": means["G"]},
        diagnostics={
            "memory": memory,
            "settling": settling,
            "trace_time": time,
            **{f"trace_{name}": trace for name, trace in traces.items()},
            "warnings": [],
        },
    )


def _lags(x, last):
    """Lags 0 … last of an input, which counts as its first value before the record began."""
    padded = np.concatenate((np.full(last, x[0]), x))
    return np.lib.stride_tricks.sliding_window_view(padded, last + 1)[:, ::-1]


def _track(inputs, target, forgetting, block, settled):
    """Predictions from the past, and the parameters that were known when each block began.

    The recursion is on the information matrix: it is exact, and cannot blow up where the perturbation is quiet.
    """
    scale = inputs.std(axis=0)
    scale[scale == 0] = 1.0
    phi = np.column_stack([inputs / scale, np.ones(target.size)])
    unknowns = phi.shape[1]
    information, projection, theta = np.zeros((unknowns, unknowns)), np.zeros(unknowns), np.zeros(unknowns)
    predicted = np.empty(target.size)
    known = np.empty((-(-target.size // block), unknowns - 1))
    for k, start in enumerate(range(0, target.size, block)):
        rows = slice(start, start + block)
        part, known[k] = phi[rows], theta[:-1] / scale
        predicted[rows] = part[:, :-1] @ theta[:-1]
        weighted = part.T * forgetting ** np.arange(len(part))[::-1]
        information = forgetting ** len(part) * information + weighted @ part
        projection = forgetting ** len(part) * projection + weighted @ target[rows]
        ridge = RIDGE * np.trace(information) / unknowns * np.eye(unknowns)
        theta = linalg.solve(information + ridge, projection, assume_a="pos")
    first = -(-settled // block)
    predicted[: first * block] = inputs[: first * block] @ known[first]
    return predicted, known
