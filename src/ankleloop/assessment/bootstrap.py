"""Intervals by the block bootstrap, for every method that has a model; they check the asymptotic intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from scipy.signal import resample_poly

from ankleloop.assessment.scores import score_torques
from ankleloop.errors import NUMERICAL_ERRORS, DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import (
    PreparedTrial,
    Trials,
    prepare,
    prepare_trials,
    sample_channel,
)
from ankleloop.joint.regressors import split_torques
from ankleloop.methods.method import Method
from ankleloop.methods.registry import identify
from ankleloop.options import check_integer, check_number
from ankleloop.signals.decimation import decimation_factor

LEAST_IDENTIFIED = 0.9  # of the repetitions: those that fail are not a random part of all


@dataclass(frozen=True)
class Bootstrap:
    """Result of a block bootstrap.

    Parameters
    ----------
    estimate : Estimate
        The estimate of the record itself.
    samples : pandas.DataFrame
        One row for each repetition: the parameters, and the VAFs [%] against the measured torque as `vaf_net`,
        `vaf_intrinsic`, `vaf_reflex`.
    failed : int
        Repetitions that the method could not identify, or whose parameters are not finite; at most a tenth of all, and
        neither the samples nor the intervals count them.

    Examples
    --------
    >>> from ankleloop import simulate
    >>> bootstrap = block_bootstrap(simulate(seed=1, duration=30.0), "riv", repetitions=2)
    >>> len(bootstrap.samples), bootstrap.failed
    (2, 0)
    """

    estimate: Estimate
    samples: pd.DataFrame
    failed: int

    def intervals(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Percentile intervals.

        Parameters
        ----------
        level : float
            Confidence.

        Returns
        -------
        dict of str to tuple of float
            Low and high of every column of `samples`.

        Raises
        ------
        ValueError
            For a level that is not between 0 and 1, or one that leaves less than one sample in each tail.
        """
        level = check_number("intervals", "level", level, gt=0, lt=1)
        fewest = int(np.ceil(2.0 / (1.0 - level) - 1e-9))
        if len(self.samples) < fewest:
            raise ValueError(
                f"an interval of level {level:g} needs at least {fewest} samples, one for each tail; there are "
                f"{len(self.samples)}: repeat more often, or take a lower level."
            )
        quantiles = self.samples.quantile([0.5 * (1.0 - level), 0.5 * (1.0 + level)])
        return {str(name): tuple(values) for name, values in quantiles.items()}

    def standard_errors(self) -> dict[str, float]:
        """Standard deviation of every column of `samples`.

        Returns
        -------
        dict of str to float
        """
        return self.samples.std().to_dict()


def block_bootstrap(
    trial: Trials,
    method: str | Method = "riv",
    *,
    repetitions: int = 200,
    block: float = 2.0,
    seed: int = 0,
    **options: Any,
) -> Bootstrap:
    r"""Repeat an identification with its residual resampled in blocks.

    The residual of the fit is cut into overlapping blocks. Blocks are drawn at random and joined to another residual of
    the same spectrum (Künsch 1989), which replaces the original one in the recorded torque. The position stays as
    recorded. The samples therefore show how the estimate scatters, but not a bias that arises because the position
    depends on the residual: the interval of a method that is biased by feedback does not hold the truth.

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial, or list of those
        The trial, or trials that are merged: the blocks of each are drawn from its own residual.
    method : str or Method
        One of `METHODS`, or another one that `ankleloop.identify` takes, that gives a net torque.
    repetitions : int
        Number of repetitions; each takes as long as an identification.
    block : float
        Length of a block [s]; longer than the residual is correlated, much shorter than the record.
    seed : int
        Seed of the draw.
    **options
        Options of the method.

    Returns
    -------
    Bootstrap

    Raises
    ------
    DataError
        If a trial is unusable or less an apparatus, if all together are less than ten blocks long or one is shorter
        than a block, or if more than a tenth of the repetitions fail: the rest would be a selection of records that
        suit the method.
    ValueError
        For an argument of another type or out of its range: 2 to 100 000 repetitions, a block of 0.001 s or more.

    See Also
    --------
    ankleloop.identify : Makes an estimate, with asymptotic intervals where its method has them.
    ankleloop.cramer_rao : The smallest standard deviations that are possible.

    References
    ----------
    H. R. Künsch, "The jackknife and the bootstrap for general stationary observations", Annals of Statistics 17(3),
    1217-1241, 1989. https://doi.org/10.1214/aos/1176347265

    Examples
    --------
    >>> from ankleloop.simulation.simulate import simulate
    >>> bootstrap = block_bootstrap(simulate(seed=1, duration=25.0), "riv", repetitions=40)
    >>> low, high = bootstrap.intervals()["K"]
    >>> low < bootstrap.estimate.stiffness["K"] < high
    True
    """
    repetitions = check_integer("block_bootstrap", "repetitions", repetitions, ge=2, le=100_000)
    block = check_number("block_bootstrap", "block", block, "s", ge=0.001, le=1e6)
    seed = check_integer("block_bootstrap", "seed", seed, ge=0)
    originals = prepare_trials(trial)
    if any(part.apparatus for part in originals):
        raise DataError(
            "draws of a trial do not show how uncertain the apparatus is that it is less: take the intervals of riv."
        )
    is_list = isinstance(trial, (list, tuple))
    estimate = identify(originals if is_list else originals[0], method, **options)
    rate = estimate.torque.attrs["identification_rate"]
    parts = split_torques(estimate.torque)
    residuals = _find_residuals(originals, estimate, parts)
    length = max(1, round(block * rate))
    sizes = [residual.size for residual in residuals]
    if sum(sizes) < 10 * length or min(sizes) < length:
        raise DataError(
            f"the estimate covers {sum(sizes) / rate:.3g} s, the shortest trial {min(sizes) / rate:.3g} s: less than "
            f"ten blocks of {block:g} s, or one. Take shorter blocks."
        )
    rng = np.random.default_rng(seed)
    rows: list[dict[str, float]] = []
    reason = "a parameter could not be estimated."
    for _ in range(repetitions):
        changes = [_draw_blocks(residual, length, rng) - residual for residual in residuals]
        resampled = _change_torques(originals, parts, changes)
        try:
            repetition = identify(resampled if is_list else resampled[0], method, **options)
            rows.append(_sample_row(resampled, repetition))
        except NUMERICAL_ERRORS as error:
            reason = str(error)
    samples = pd.DataFrame(rows, columns=list(_sample_row(originals, estimate)), dtype=float)
    samples = samples.replace([np.inf, -np.inf], np.nan).dropna(ignore_index=True)
    failed = repetitions - len(samples)
    if len(samples) < max(2.0, LEAST_IDENTIFIED * repetitions):
        raise DataError(
            f"{estimate.method} failed on {failed} of {repetitions} resampled records, but an interval needs "
            f"{LEAST_IDENTIFIED:.0%} of them. The last one failed with: {reason}"
        )
    return Bootstrap(estimate, samples, failed)


def _draw_blocks(residual: np.ndarray, length: int, rng: np.random.Generator) -> np.ndarray:
    """Another residual of zero mean, from blocks of one whose end continues at its start.

    Shapes: residual (N,); returns (N,).
    """
    size = residual.size
    starts = rng.integers(0, size, -(-size // length))
    rows = np.add.outer(starts, np.arange(length)).ravel()[:size]
    blocks = residual[rows % size]
    return blocks - blocks.mean()


def _find_residuals(
    trials: Sequence[PreparedTrial], estimate: Estimate, torques: Sequence[xr.Dataset]
) -> list[np.ndarray]:
    """What an estimate, whose torques are those of each trial, leaves of their torque, less its mean."""
    measured = sample_channel(trials, "torque", estimate.torque)
    residuals = []
    for torque, part in zip(measured, torques, strict=True):
        residual = torque - part["net"].values
        residuals.append(residual - residual.mean())
    return residuals


def _change_torques(
    trials: Sequence[PreparedTrial],
    torques: Sequence[xr.Dataset],
    changes: Sequence[np.ndarray],
) -> list[PreparedTrial]:
    """Trials with a change of their torque, which is given at the samples of an estimate's torques."""
    rate = torques[0].attrs["identification_rate"]
    changed = []
    for trial, part, change in zip(trials, torques, changes, strict=True):
        dataset = trial.trial
        start = float(part["time"][0])
        first = round((start - trial.time[0]) * trial.rate)
        recorded = resample_poly(change, decimation_factor(trial.rate, rate), 1)
        torque = dataset["torque"].copy(deep=True)
        values = torque.values[first : first + recorded.size]
        values += recorded[: values.size]
        truths = [name for name in dataset.data_vars if str(name).startswith("torque")]
        changed.append(prepare(dataset.drop_vars(truths).assign(torque=torque)))
    return changed


def _sample_row(trials: Sequence[PreparedTrial], estimate: Estimate) -> dict[str, float]:
    """Parameters and VAFs of a repetition."""
    scores = score_torques(trials, estimate, "measured", intervals=False)
    vafs = {f"vaf_{torque}": vaf for torque, _, vaf in scores}
    return {**estimate.values, **vafs}
