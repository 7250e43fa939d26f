"""The parallel-cascade method: two impulse responses, estimated in turn (Kearney, Stein and Parameswaran 1997)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import DriveSpectra, separate_response
from ankleloop.joint.model_inputs import ModelInputs
from ankleloop.joint.models import ResponseModel
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import Regressors
from ankleloop.methods.method import Method, check_lags, delay_option, rate_option
from ankleloop.options import Options, option
from ankleloop.subspace.hankel import hankel_gram

PASS_CEILING = 10_000  # beyond any loop that converges at all
SQUARED = 1e-10  # least ratio of eigenvalues for which inner products show all directions


class ParallelCascadeOptions(Options):
    """Options of the parallel cascade."""

    delay: float = delay_option()
    basis: Literal["rectifier"] | None = option(
        None, "static nonlinearity; null for the method's own (rectifier), the only one that it has"
    )
    identification_rate: float = rate_option()
    max_passes: int | None = option(
        None, "most passes; 1 is the method as published, null runs to convergence", ge=1, le=PASS_CEILING
    )
    tolerance: float = option(
        0.001, "converged when a pass adds less than this to the net VAF", unit="points of VAF", ge=0, le=100
    )
    intrinsic_lags: float = option(
        0.04, "half length of the two-sided intrinsic impulse response", unit="s", ge=0, le=1
    )
    reflex_lags: float = option(0.5, "length of the reflex impulse response", unit="s", ge=0.001, le=5)
    rank: Literal["full", "mdl"] = option(
        "full",
        "rank of the pseudo-inverse, full or of minimum description length (Westwick and Kearney 1997)",
    )
    rank_tolerance: float = option(
        1e-6, "singular values of the lagged inputs below this fraction of the largest count as zero", ge=0, lt=1
    )

    @model_validator(mode="after")
    def _check_lags(self) -> Self:
        check_lags("intrinsic_lags", self.intrinsic_lags, self.identification_rate, least=0)
        check_lags("reflex_lags", self.reflex_lags, self.identification_rate)
        return self


@dataclass(frozen=True)
class _Pathway:
    """One path: inner products of its lagged inputs, and directions in which these are orthonormal."""

    gram: np.ndarray
    with_torque: np.ndarray
    directions: np.ndarray

    def fit(self, with_target: np.ndarray, target_energy: float, samples: int, rank: str) -> np.ndarray:
        """Impulse response that best explains a target, from its products with the lagged inputs and its energy."""
        projections = self.directions.T @ with_target
        selection = _select_directions(projections, target_energy, samples, rank)
        return self.directions[:, selection] @ projections[selection]

    def residual(self, with_target: np.ndarray, target_energy: float, response: np.ndarray) -> float:
        """Energy of a target less the torque of a response, from the target's products and energy."""
        return float(target_energy - 2.0 * with_target @ response + response @ self.gram @ response)


def _select_directions(projections: np.ndarray, energy: float, samples: int, rank: str) -> np.ndarray:
    """Directions of the pseudo-inverse; "mdl" takes as many as shorten the description of the target."""
    if rank == "full":
        return np.arange(projections.size)
    order = np.argsort(projections**2)[::-1]
    residual = np.maximum(energy - np.cumsum(projections[order] ** 2), np.finfo(float).tiny)
    terms = np.arange(1, order.size + 1)
    return order[: int(np.argmin(residual * (1 + terms * np.log(samples) / samples))) + 1]


def _directions(gram: np.ndarray, lagged_inputs: Callable[[], np.ndarray], rank_tolerance: float) -> np.ndarray:
    """Directions of lagged inputs, each over its singular value; those below the tolerance are left out."""
    values, vectors = np.linalg.eigh(gram)
    if values[0] > max(SQUARED, 4.0 * rank_tolerance**2) * values[-1]:
        return vectors / np.sqrt(values)
    # Squares do not show which directions count: the lagged inputs themselves do.
    _, values, vectors = np.linalg.svd(lagged_inputs(), full_matrices=False)
    significant = values > rank_tolerance * values[0]
    return vectors[significant].T / values[significant]


def _lag_input(x: np.ndarray, lags: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Lags of an input (negative ones lead) at some samples, each less its mean."""
    lagged = np.stack([x[rows - lag] for lag in lags], axis=1)
    return lagged - lagged.mean(axis=0)


def _paths(
    regressors: Regressors, rows: np.ndarray, lags: tuple[np.ndarray, np.ndarray], rank_tolerance: float
) -> tuple[list[_Pathway], np.ndarray, float]:
    """Both paths, the products of their lagged inputs with each other, and the energy of the torque.

    Lags of a signal are rows of a Hankel matrix, so all of these are entries of one Gram matrix.
    """
    inputs = regressors.inputs[:, [0, -1]]
    window = rows[0] + regressors.torque.size - rows[-1]
    products = hankel_gram([np.column_stack([inputs, regressors.torque])], window)
    present = rows[0] * 3  # row of lag 0 of the first of three channels
    torque = present + 2
    indices = [present - 3 * path_lags + channel for channel, path_lags in enumerate(lags)]
    paths = []
    for channel, (path_lags, index) in enumerate(zip(lags, indices, strict=True)):
        path_gram = products[np.ix_(index, index)]
        lagged_inputs = partial(_lag_input, inputs[:, channel], path_lags, rows)
        directions = _directions(path_gram, lagged_inputs, rank_tolerance)
        paths.append(_Pathway(path_gram, products[index, torque], directions))
    return paths, products[np.ix_(*indices)], products[torque, torque]


def identify_parallel_cascade(trial: PreparedTrial, options: ParallelCascadeOptions) -> Estimate:
    r"""Separate intrinsic and reflex torque by the parallel-cascade method.

    The intrinsic path is a two-sided impulse response of the position (± `intrinsic_lags`), the reflex path a
    one-sided impulse response of the delayed, rectified velocity (0 … `reflex_lags`). Each pass fits the intrinsic
    path to the torque less that of the reflex path, then the reflex path to the torque less that of the intrinsic
    path: alternating least squares. It is a correlation method, so torque that is fed back biases it.

    Parameters
    ----------
    trial : PreparedTrial
        The trial.
    options : ParallelCascadeOptions
        The options.

    Returns
    -------
    Estimate
        `model` is None; the impulse responses and the history of passes are in `diagnostics`. K, B and I are those of
        the second-order model that explains the intrinsic torque best; G, ωn and ζ those of the low-pass that is
        closest to the reflex response.

    Raises
    ------
    DataError
        If the record is unusable or too short.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = simulate(seed=1, duration=20.0, snr_db=None, voluntary=0.0, reflex_gain=2.0)
    >>> estimate = identify(trial, "parallel-cascade")
    >>> bool(estimate.diagnostics["converged"]), bool(abs(estimate.stiffness["K"] - 150) < 2)
    (True, True)
    """
    regressors = trial.regressors(
        delay=options.delay, basis="rectifier", identification_rate=options.identification_rate
    )
    lags, rows = _lags_and_rows(regressors, options)
    key = (
        options.delay,
        options.identification_rate,
        options.intrinsic_lags,
        options.reflex_lags,
        options.rank_tolerance,
    )
    paths, cross_products, energy = trial.memoise(
        ("cascade paths", *key), lambda: _paths(regressors, rows, lags, options.rank_tolerance)
    )
    responses, history, converged = _alternate(paths, cross_products, energy, rows.size, options)
    model = ResponseModel(ModelInputs.of(regressors), *responses)
    torque = model.simulate(regressors)
    spectra = trial.memoise(
        ("cascade spectra", *key), lambda: DriveSpectra.of(regressors.inputs[rows, -1:], regressors.rate)
    )
    path = separate_response(responses[1], spectra, regressors.rate, regressors.basis)
    unconverged = not converged and options.max_passes is None
    return Estimate(
        method="parallel-cascade",
        torque=torque,
        matrices=None,
        stiffness=regressors.fit_stiffness(torque["intrinsic"].values, rows),
        reflex={"delay": options.delay, **path.valid_parameters},
        diagnostics={
            "passes": len(history),
            "converged": converged,
            "history": history,
            "intrinsic_response": responses[0],
            "intrinsic_lags": lags[0] / regressors.rate,
            "reflex_response": responses[1],
            "reflex_lags": lags[1] / regressors.rate,
            **path.diagnostics,
            "warnings": [f"no convergence within {PASS_CEILING} passes"] if unconverged else [],
        },
        predictor=model,
    )


def _lags_and_rows(
    regressors: Regressors, options: ParallelCascadeOptions
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Lags of both impulse responses, and the samples that have all of them."""
    leads, lags = round(options.intrinsic_lags * regressors.rate), round(options.reflex_lags * regressors.rate)
    rows = np.arange(max(leads, lags), regressors.torque.size - leads)
    unknowns = 2 * leads + 1 + lags + 1
    if rows.size < 2 * unknowns:
        raise DataError(
            f"the record leaves {max(rows.size, 0)} samples for {unknowns} unknowns: record longer, or shorten "
            "intrinsic_lags and reflex_lags."
        )
    return (np.arange(-leads, leads + 1), np.arange(lags + 1)), rows


def _alternate(
    paths: Sequence[_Pathway],
    cross_products: np.ndarray,
    energy: float,
    samples: int,
    options: ParallelCascadeOptions,
) -> tuple[tuple[np.ndarray, np.ndarray], list[float], bool]:
    """Alternating least squares; the history holds the net VAF after each pass."""
    intrinsic, reflex = paths
    rank = options.rank
    reflex_response = np.zeros(reflex.with_torque.size)
    history: list[float] = []
    for _ in range(options.max_passes or PASS_CEILING):
        residual = reflex.residual(reflex.with_torque, energy, reflex_response)
        target = intrinsic.with_torque - cross_products @ reflex_response
        intrinsic_response = intrinsic.fit(target, residual, samples, rank)
        residual = intrinsic.residual(intrinsic.with_torque, energy, intrinsic_response)
        target = reflex.with_torque - intrinsic_response @ cross_products
        reflex_response = reflex.fit(target, residual, samples, rank)
        residual = reflex.residual(target, residual, reflex_response)
        history.append(float(100 * (1 - residual / energy)))
        if len(history) > 1 and history[-1] - history[-2] < options.tolerance:
            return (intrinsic_response, reflex_response), history, True
    return (intrinsic_response, reflex_response), history, False


METHODS = (Method("parallel-cascade", ParallelCascadeOptions, identify_parallel_cascade),)
