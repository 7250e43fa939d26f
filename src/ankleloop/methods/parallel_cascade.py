"""The parallel-cascade method: two impulse responses, estimated in turn (Kearney, Stein and Parameswaran 1997)."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.estimate import Estimate, torque_dataset
from ankleloop.hammerstein import response_gain
from ankleloop.regressors import build_regressors

__all__ = ["identify_parallel_cascade"]

RANKS = ("full", "mdl")
PASS_CEILING = 10_000  # beyond any loop that converges at all


@dataclass(frozen=True)
class _Pathway:
    """Lagged inputs of one path in an orthonormal basis: a fit is a projection."""

    lags: np.ndarray
    responses: np.ndarray
    scores: np.ndarray

    def fit(self, target, rank):
        """Impulse response that best explains a target, and the torque it gives."""
        projections = self.scores.T @ target
        kept = _kept(projections, target, rank)
        return self.responses[:, kept] @ projections[kept], self.scores[:, kept] @ projections[kept]


def _kept(projections, target, rank):
    """Directions of the pseudo-inverse to keep; "mdl" takes as many as shorten the description of the target."""
    if rank == "full":
        return np.arange(projections.size)
    order = np.argsort(projections**2)[::-1]
    residual = np.maximum(target @ target - np.cumsum(projections[order] ** 2), np.finfo(float).tiny)
    terms = np.arange(1, order.size + 1)
    return order[: int(np.argmin(residual * (1 + terms * np.log(target.size) / target.size))) + 1]


def _pathway(x, first, last, rows, rank_tolerance):
    """Lags first … last of an input (negative lags lead), at the given samples."""
    lags = np.arange(first, last + 1)
    lagged = np.stack([x[rows - lag] for lag in lags], axis=1)
    left, values, right = linalg.svd(lagged - lagged.mean(axis=0), full_matrices=False)
    kept = values > rank_tolerance * values[0]
    return _Pathway(lags, right[kept].T / values[kept], left[:, kept])


def identify_parallel_cascade(
    trial,
    *,
    delay=0.04,
    basis=None,
    identification_rate=100.0,
    max_passes=None,
    tolerance=1e-3,
    intrinsic_lags=0.04,
    reflex_lags=0.5,
    rank="full",
    rank_tolerance=1e-6,
):
    r"""Separate intrinsic and reflex torque by the parallel-cascade method.

    The intrinsic path is a two-sided impulse response of the position (± `intrinsic_lags`), the reflex path a
    one-sided impulse response of the delayed, rectified velocity (0 … `reflex_lags`). Each pass fits the intrinsic
    path to the torque that the reflex path leaves, then the reflex path to what the intrinsic path leaves: alternating
    least squares. It is a correlation method, so torque that is fed back biases it.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial; a reference is not used.
    delay : float
        Reflex delay [s].
    basis : {"rectifier"}, optional
        Static nonlinearity; the method has one input for the reflex path, the half-wave rectified velocity.
    identification_rate : float
        Rate of the identification [Hz].
    max_passes : int or None
        Most passes; 1 is the method as published, None runs to convergence.
    tolerance : float
        Converged when a pass adds less than this to the net VAF [points].
    intrinsic_lags, reflex_lags : float
        Lengths of the impulse responses [s].
    rank : {"full", "mdl"}
        Pseudo-inverse of full rank, or of the rank of minimum description length (Westwick and Kearney 1997).
    rank_tolerance : float
        Singular values of the lagged inputs below this fraction of the largest count as zero.

    Returns
    -------
    Estimate
        `model` is None; the impulse responses and the history of passes are in `diagnostics`. K, B and I are those of
        the second-order model that explains the intrinsic torque best; G, ωn and ζ those of the low-pass that comes
        closest to the reflex response.

    Raises
    ------
    DataError
        If the record is unusable or too short.

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> trial = simulate(seed=1, duration=20.0, snr_db=None, voluntary=0.0, reflex_gain=2.0)
    >>> estimate = identify_parallel_cascade(trial)
    >>> bool(estimate.diagnostics["converged"]), bool(abs(estimate.stiffness["K"] - 150) < 2)
    (True, True)
    """
    if rank not in RANKS:
        raise ValueError(f"unknown rank {rank!r}; known: {', '.join(RANKS)}.")
    if basis not in (None, "rectifier"):
        raise ValueError(f"the parallel cascade has one reflex input: basis must be 'rectifier', got {basis!r}.")
    if max_passes is not None and max_passes < 1:
        raise ValueError(f"max_passes must be at least 1, or None to run to convergence; got {max_passes!r}.")
    regressors = build_regressors(
        trial, delay=delay, basis="rectifier", degree=1, identification_rate=identification_rate
    )
    ahead, behind = round(intrinsic_lags * regressors.rate), round(reflex_lags * regressors.rate)
    rows = np.arange(max(ahead, behind), regressors.torque.size - ahead)
    unknowns = 2 * ahead + 1 + behind + 1
    if rows.size < 2 * unknowns:
        raise DataError(
            f"the record leaves {max(rows.size, 0)} samples for {unknowns} unknowns: record longer, or shorten "
            "intrinsic_lags and reflex_lags."
        )
    paths = (
        _pathway(regressors.inputs[:, 0], -ahead, ahead, rows, rank_tolerance),
        _pathway(regressors.inputs[:, -1], 0, behind, rows, rank_tolerance),
    )
    responses, torques, history, converged = _alternate(paths, regressors.torque[rows], rank, max_passes, tolerance)
    warnings = [] if converged or max_passes else [f"no convergence within {PASS_CEILING} passes"]
    intrinsic, reflex = torques
    path = response_gain(responses[1], regressors.inputs[rows, -1], regressors.rate, regressors.basis)
    return Estimate(
        method="parallel-cascade",
        torque=torque_dataset(
            regressors.time[rows], regressors.rate, net=intrinsic + reflex, intrinsic=intrinsic, reflex=reflex
        ),
        matrices=None,
        stiffness=regressors.stiffness(intrinsic, rows),
        reflex={"delay": float(delay), **path.parameters},
        diagnostics={
            "passes": len(history),
            "converged": converged,
            "history": history,
            "intrinsic_response": responses[0],
            "intrinsic_lags": paths[0].lags / regressors.rate,
            "reflex_response": responses[1],
            "reflex_lags": paths[1].lags / regressors.rate,
            **path.diagnostics,
            "warnings": warnings,
        },
        predictor=_Predictor(responses, ahead, delay, regressors.basis, regressors.rate),
    )


@dataclass(frozen=True)
class _Predictor:
    """Torques of another trial by the same impulse responses."""

    responses: tuple
    ahead: int
    delay: float
    basis: object
    rate: float

    def __call__(self, trial):
        regressors = build_regressors(trial, delay=self.delay, basis=self.basis, identification_rate=self.rate)
        intrinsic, reflex = self.responses
        rows = slice(max(self.ahead, reflex.size - 1), regressors.torque.size - self.ahead)
        inputs = regressors.inputs - regressors.inputs.mean(axis=0)
        torques = {
            "intrinsic": np.convolve(inputs[:, 0], intrinsic)[self.ahead :][rows],
            "reflex": np.convolve(inputs[:, -1], reflex)[rows],
        }
        torques = {name: torque - torque.mean() for name, torque in torques.items()}
        net = torques["intrinsic"] + torques["reflex"]
        return torque_dataset(regressors.time[rows], regressors.rate, net=net, **torques)


def _alternate(paths, torque, rank, max_passes, tolerance):
    """Alternating least squares; the history holds the net VAF after each pass."""
    torque = torque - torque.mean()
    total = torque @ torque
    reflex = np.zeros_like(torque)
    history = []
    for _ in range(max_passes or PASS_CEILING):
        intrinsic_response, intrinsic = paths[0].fit(torque - reflex, rank)
        reflex_response, reflex = paths[1].fit(torque - intrinsic, rank)
        residual = torque - intrinsic - reflex
        history.append(float(100 * (1 - (residual @ residual) / total)))
        if len(history) > 1 and history[-1] - history[-2] < tolerance:
            return (intrinsic_response, reflex_response), (intrinsic, reflex), history, True
    return (intrinsic_response, reflex_response), (intrinsic, reflex), history, False
