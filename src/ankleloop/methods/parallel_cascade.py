"""The parallel-cascade method: two impulse responses, estimated in turn (Kearney, Stein and Parameswaran 1997)."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate, torque_dataset
from ankleloop.joint.hammerstein import response_gain
from ankleloop.joint.once import once
from ankleloop.joint.regressors import build_regressors
from ankleloop.subspace.hankel_gram import HankelGram

__all__ = ["identify_parallel_cascade"]

RANKS = ("full", "mdl")
PASS_CEILING = 10_000  # beyond any loop that converges at all
SQUARED = 1e-10  # least ratio of eigenvalues for which inner products show all directions


@dataclass(frozen=True)
class _Pathway:
    """One path: inner products of its lagged inputs, and directions in which these are orthonormal."""

    gram: np.ndarray
    with_torque: np.ndarray
    directions: np.ndarray

    def fit(self, with_target, energy, samples, rank):
        """Impulse response that best explains a target, from its products with the lagged inputs and its energy."""
        projections = self.directions.T @ with_target
        kept = _kept(projections, energy, samples, rank)
        return self.directions[:, kept] @ projections[kept]

    def energy(self, response):
        """Sum of squares of the torque of a response."""
        return response @ self.gram @ response


def _kept(projections, energy, samples, rank):
    """Directions of the pseudo-inverse to keep; "mdl" takes as many as shorten the description of the target."""
    if rank == "full":
        return np.arange(projections.size)
    order = np.argsort(projections**2)[::-1]
    residual = np.maximum(energy - np.cumsum(projections[order] ** 2), np.finfo(float).tiny)
    terms = np.arange(1, order.size + 1)
    return order[: int(np.argmin(residual * (1 + terms * np.log(samples) / samples))) + 1]


def _directions(gram, lagged, rank_tolerance):
    """Directions of lagged inputs, each over its singular value; those below the tolerance are left out."""
    values, vectors = np.linalg.eigh(gram)
    if values[0] > max(SQUARED, 4.0 * rank_tolerance**2) * values[-1]:
        return vectors / np.sqrt(values)
    # Squares do not show which directions count: the lagged inputs themselves do.
    _, values, right = np.linalg.svd(lagged(), full_matrices=False)
    kept = values > rank_tolerance * values[0]
    return right[kept].T / values[kept]


def _lagged(x, lags, rows):
    """Lags of an input (negative ones lead) at some samples, each less its mean."""
    lagged = np.stack([x[rows - lag] for lag in lags], axis=1)
    return lagged - lagged.mean(axis=0)


def _paths(regressors, rows, lags, rank_tolerance):
    """Both paths, the products of their lagged inputs with each other, and the energy of the torque.

    Lags of a signal are rows of a Hankel matrix, so all of these are entries of one Gram matrix.
    """
    inputs = regressors.inputs[:, [0, -1]]
    window = rows[0] + regressors.torque.size - rows[-1]
    gram = HankelGram(window)
    gram.add(np.column_stack([inputs, regressors.torque]))
    products = gram.matrix()
    present = rows[0] * 3
    at = [present - 3 * which + channel for channel, which in enumerate(lags)]
    torque = present + 2
    paths = []
    for channel, (which, index) in enumerate(zip(lags, at, strict=True)):
        own = products[np.ix_(index, index)]
        lagged = partial(_lagged, inputs[:, channel], which, rows)
        paths.append(_Pathway(own, products[index, torque], _directions(own, lagged, rank_tolerance)))
    return paths, products[np.ix_(*at)], products[torque, torque]


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
    lags = np.arange(-ahead, ahead + 1), np.arange(behind + 1)
    settings = ("paths", delay, identification_rate, ahead, behind, rank_tolerance)
    paths, crossed, energy = once(trial, settings, lambda: _paths(regressors, rows, lags, rank_tolerance))
    responses, history, converged = _alternate(paths, crossed, energy, rows.size, rank, max_passes, tolerance)
    intrinsic, reflex = (
        _centred(_responded(x, response, which[0])[rows])
        for x, response, which in zip(regressors.inputs[:, [0, -1]].T, responses, lags, strict=True)
    )
    warnings = [] if converged or max_passes else [f"no convergence within {PASS_CEILING} passes"]
    drive = once(regressors.inputs, ("drive", rows[0], rows[-1]), lambda: regressors.inputs[rows, -1])
    path = response_gain(responses[1], drive, regressors.rate, regressors.basis)
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
            "intrinsic_lags": lags[0] / regressors.rate,
            "reflex_response": responses[1],
            "reflex_lags": lags[1] / regressors.rate,
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
        torques = {
            "intrinsic": _centred(_responded(regressors.inputs[:, 0], intrinsic, -self.ahead)[rows]),
            "reflex": _centred(_responded(regressors.inputs[:, -1], reflex, 0)[rows]),
        }
        net = torques["intrinsic"] + torques["reflex"]
        return torque_dataset(regressors.time[rows], regressors.rate, net=net, **torques)


def _responded(x, response, first):
    """Torque of an impulse response whose first lag is given."""
    return np.convolve(x - x.mean(), response)[-first:][: x.size]


def _centred(torque):
    return torque - torque.mean()


def _alternate(paths, crossed, energy, samples, rank, max_passes, tolerance):
    """Alternating least squares; the history holds the net VAF after each pass."""
    intrinsic, reflex = paths
    reflex_response = np.zeros(reflex.with_torque.size)
    history = []
    for _ in range(max_passes or PASS_CEILING):
        left = energy - 2.0 * reflex.with_torque @ reflex_response + reflex.energy(reflex_response)
        intrinsic_response = intrinsic.fit(intrinsic.with_torque - crossed @ reflex_response, left, samples, rank)
        left = energy - 2.0 * intrinsic.with_torque @ intrinsic_response + intrinsic.energy(intrinsic_response)
        target = reflex.with_torque - intrinsic_response @ crossed
        reflex_response = reflex.fit(target, left, samples, rank)
        left = left - 2.0 * target @ reflex_response + reflex.energy(reflex_response)
        history.append(float(100 * (1 - left / energy)))
        if len(history) > 1 and history[-1] - history[-2] < tolerance:
            return (intrinsic_response, reflex_response), history, True
    return (intrinsic_response, reflex_response), history, False
