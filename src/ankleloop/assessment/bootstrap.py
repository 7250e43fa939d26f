"""Intervals by the block bootstrap, for every method that has a model: the check of the asymptotic ones."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr
from scipy.signal import resample_poly

from ankleloop.assessment.scores import evaluate
from ankleloop.errors import DataError
from ankleloop.joint.regressors import decimated
from ankleloop.methods.registry import identify
from ankleloop.records.trial import validate
from ankleloop.signals.decimation import decimation_factor

__all__ = ["Bootstrap", "block_bootstrap"]


@dataclass(frozen=True)
class Bootstrap:
    """What a block bootstrap found.

    Parameters
    ----------
    estimate : Estimate
        The estimate of the record itself.
    samples : pandas.DataFrame
        One row for each repetition: the parameters, and the VAFs [%] as `vaf_net`, `vaf_intrinsic`, `vaf_reflex`.
    failed : int
        Repetitions on which the method refused to work.
    """

    estimate: object
    samples: pd.DataFrame
    failed: int

    def intervals(self, level=0.95):
        """Percentile intervals.

        Parameters
        ----------
        level : float
            Confidence.

        Returns
        -------
        dict of str to tuple of float
            Low and high of every column of `samples`.
        """
        tail = 50.0 * (1.0 - level)
        return {
            name: tuple(map(float, np.percentile(values, [tail, 100.0 - tail])))
            for name, values in self.samples.items()
        }

    def standard_errors(self):
        """Standard deviation of every column of `samples`.

        Returns
        -------
        dict of str to float
        """
        return {name: float(values.std(ddof=1)) for name, values in self.samples.items()}


def block_bootstrap(trial, method="riv", *, repetitions=200, block=2.0, seed=0, progress=None, **options):
    r"""Repeat an identification with its residual resampled in blocks.

    The residual of the fit is cut into overlapping blocks; blocks drawn at random, one after the other, make another
    residual of the same spectrum (Künsch 1989), which is put in the place of the first one in the recorded torque. The
    position stays as it was recorded. So this shows how the estimate scatters, not how far it is biased where the
    position depends on the residual: an interval of a method that feedback biases does not hold the truth.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    method : str
        One of `METHODS` that gives a net torque.
    repetitions : int
        Number of repetitions; each takes as long as an identification.
    block : float
        Length of a block [s]; longer than the residual is correlated, much shorter than the record.
    seed : int
        Seed of the draw.
    progress : callable, optional
        Wraps the range of repetitions, as tqdm does.
    **options
        Options of the method.

    Returns
    -------
    Bootstrap

    Raises
    ------
    DataError
        If the trial is unusable, or less than ten blocks long.
    ValueError
        For fewer than two repetitions or a block that is not positive.

    References
    ----------
    H. R. Künsch, "The jackknife and the bootstrap for general stationary observations", Annals of Statistics 17(3),
    1217-1241, 1989.

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> found = block_bootstrap(simulate(seed=1, duration=25.0), "riv", repetitions=20)
    >>> low, high = found.intervals()["K"]
    >>> low < found.estimate.stiffness["K"] < high
    True
    """
    if repetitions < 2 or not block > 0:
        raise ValueError(f"repetitions must be at least 2 and block positive, got {repetitions!r} and {block!r} s.")
    estimate = identify(trial, method, **options)
    time, rate = estimate.torque["time"].values, estimate.torque.attrs["identification_rate"]
    residual = decimated(trial, "torque", time, rate) - estimate.torque["net"].values
    residual -= residual.mean()
    length = round(block * rate)
    if residual.size < 10 * length:
        raise DataError(
            f"the estimate covers {residual.size / rate:.3g} s, less than ten blocks of {block:g} s: take shorter ones."
        )
    rng = np.random.default_rng(seed)
    rows, failed = [], 0
    for _ in (progress or iter)(range(repetitions)):
        resampled = _with_residual(trial, time, rate, _drawn(rng, residual, length) - residual)
        try:
            rows.append(_row(resampled, identify(resampled, method, **options)))
        except DataError:
            failed += 1
    if len(rows) < 2:
        raise DataError(f"{method} refused {failed} of {repetitions} resampled records: it cannot be relied on here.")
    return Bootstrap(estimate, pd.DataFrame(rows), failed)


def _drawn(rng, residual, length):
    """Blocks drawn with replacement from a residual that is closed to a circle."""
    starts = rng.integers(0, residual.size, -(-residual.size // length))
    drawn = residual[(starts[:, None] + np.arange(length)).ravel()[: residual.size] % residual.size]
    return drawn - drawn.mean()


def _with_residual(trial, time, rate, change):
    """The trial with a change of its torque, given at the identification rate."""
    recording_rate = float(trial.attrs["sampling_rate"])
    factor = decimation_factor(recording_rate, rate)
    first = round((time[0] - float(trial["time"][0])) * recording_rate)
    fine = resample_poly(change, factor, 1)[: trial.sizes["time"] - first]
    torque = trial["torque"].values.copy()
    torque[first : first + fine.size] += fine
    kept = {name: trial[name] for name in trial.data_vars if not str(name).startswith("torque")}
    return validate(xr.Dataset({**kept, "torque": trial["torque"].copy(data=torque)}, attrs=trial.attrs))


def _row(trial, estimate):
    scores = evaluate(trial, estimate)
    vafs = {f"vaf_{row.torque}": row.vaf for row in scores.itertuples()}
    return {**estimate.stiffness, **estimate.reflex, **vafs}
