"""From a trial to the inputs of Eq. 3, 9 and 11, all decimated through the same kernel."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.basis import Basis, fit_basis
from ankleloop.joint.once import once
from ankleloop.joint.reference_response import explained_by
from ankleloop.records.trial import validate
from ankleloop.signals.decimation import (
    decimate,
    decimation_factor,
    decimation_margin,
    differentiate,
    differentiation_margin,
)
from ankleloop.subspace.records import centred

__all__ = [
    "INTRINSIC_NAMES",
    "Regressors",
    "assembled",
    "build_regressors",
    "check_delay",
    "decimated",
    "inputs_of",
    "predicted_inputs",
    "recording_grid",
    "recording_margins",
    "share_channels",
    "shared_basis",
]

INTRINSIC_NAMES = ("position", "velocity", "acceleration")
SHARED = {"torque", "reference", "torque_intrinsic", "torque_reflex"}  # what every method is made of, or scored by
INTRINSIC_UNITS = ("rad", "rad/s", "rad/s²")


@dataclass(frozen=True)
class Regressors:
    """Inputs and output of an identification.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Time in the record [s].
    inputs : ndarray, shape (N, 3 + k)
        P, Ṗ, P̈ and the basis functions of the delayed velocity.
    basis : Basis
        Basis of the nonlinearity, with its scale or knots.
    torque : ndarray, shape (N,)
        Measured net torque [N·m].
    reference : ndarray, shape (N,), or None
        Reference of the loop [rad].
    reference_name : str or None
        Variable that serves as reference.
    rate : float
        Identification rate [Hz].
    """

    time: np.ndarray
    inputs: np.ndarray
    basis: Basis
    torque: np.ndarray
    reference: np.ndarray | None
    reference_name: str | None
    rate: float

    @property
    def names(self):
        """Name of every input."""
        return (*INTRINSIC_NAMES, *self.basis.names)

    @property
    def units(self):
        """Unit of every input."""
        return (*INTRINSIC_UNITS, *self.basis.units)

    @property
    def reflex(self):
        """Boolean mask of the inputs of the reflex path."""
        return np.arange(self.inputs.shape[1]) >= len(INTRINSIC_NAMES)

    @property
    def centred_inputs(self):
        """Inputs of the intrinsic and of the reflex path, without their means."""
        return once(self.inputs, "centred", lambda: np.split(centred([self.inputs])[0], [len(INTRINSIC_NAMES)], axis=1))

    def stiffness(self, torque, rows=slice(None)):
        """K, B and I of the second-order model that explains a torque, given at some of the samples, best."""
        motion = centred([self.inputs[rows, : len(INTRINSIC_NAMES)]])[0]
        found = np.linalg.lstsq(motion, torque - np.mean(torque), rcond=None)[0]
        return dict(zip("KBI", map(float, found), strict=True))


def recording_grid(trial, identification_rate, delay):
    """Factor, first recorded index and number of the identified samples that no filter edge touches.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    identification_rate : float
        Rate of the identification [Hz].
    delay : float
        Reflex delay [s].

    Returns
    -------
    tuple of int

    Raises
    ------
    DataError
        If the record is too short.
    """
    rate = float(trial.attrs["sampling_rate"])
    factor = decimation_factor(rate, identification_rate)
    first, after = recording_margins(rate, factor, delay)
    last = trial.sizes["time"] - 1 - after
    count = (last - first) // factor + 1
    if count < 2:
        raise DataError(
            f"the record of {trial.sizes['time'] / rate:.3g} s is too short: its filters touch "
            f"{(first + after) / rate:.3g} s at the ends. Record longer."
        )
    return factor, first, count


def recording_margins(rate, factor, delay):
    """Recorded samples that the filters touch: before the first identified one, in whole factors, and after the last.

    Parameters
    ----------
    rate : float
        Recording rate [Hz].
    factor : int
        Decimation factor.
    delay : float
        Reflex delay [s].

    Returns
    -------
    tuple of int
    """
    margin = decimation_margin(factor)
    before, after = differentiation_margin(rate, delay)
    return -(-(margin + max(before, 0)) // factor) * factor, margin + max(after, 0)


def build_regressors(trial, *, delay, basis, degree=1, identification_rate, reference=None):
    """Differentiate, delay, expand and decimate a trial.

    Velocity for the nonlinearity is taken at the recording rate through a wide differentiator, delayed and expanded
    there; every term is decimated only then, because a rectifier after decimation is another rectifier.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    delay : float
        Reflex delay [s].
    basis : {"chebyshev", "rectifier", "spline"} or Basis
        Basis of the nonlinearity; one that is settled already is taken as it is.
    degree : int
        Number of its terms.
    identification_rate : float
        Rate of the identification [Hz].
    reference : str or None
        Variable that serves as reference; None for none.

    Returns
    -------
    Regressors

    Raises
    ------
    DataError
        For an unusable trial, a missing reference, or a sampling rate that is not a multiple of the rate.

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> regressors = build_regressors(simulate(seed=1, duration=5.0), delay=0.04, basis="rectifier", degree=1,
    ...                               identification_rate=100.0)
    >>> regressors.names
    ('position', 'velocity', 'acceleration', 'rectified_velocity')
    """
    once(trial, "valid", lambda: validate(trial))
    check_delay(delay)
    if reference is not None and reference not in trial:
        known = ", ".join(map(str, trial.data_vars))
        raise DataError(
            f"the trial has no variable {reference!r} to serve as reference; it has {known}."
            " Give the command of the servo as reference, or reference='position' for an open-loop record."
        )
    return assembled(trial, delay, basis, degree, identification_rate, reference)


def check_delay(delay):
    """Refuse a delay that is none."""
    if delay is None or not 0 <= delay <= 1:
        raise ValueError(f"delay must be a time between 0 and 1 s (this method does not estimate it), got {delay!r}.")


def assembled(trial, delay, basis, degree, identification_rate, reference):
    """Regressors of a trial, or of a chunk of one, that is known to be fit for it; see `build_regressors`."""
    grid = recording_grid(trial, identification_rate, delay)
    factor, first, count = grid
    fitted, inputs = _expanded(trial, delay, basis, degree, grid)
    return Regressors(
        time=trial.variables["time"].values[first : first + factor * count : factor],
        inputs=inputs,
        basis=fitted,
        torque=_channel(trial, "torque", grid),
        reference=None if reference is None else _channel(trial, reference, grid),
        reference_name=reference,
        rate=float(identification_rate),
    )


def _channel(trial, name, grid):
    return once(trial, ("channel", name, grid), lambda: decimate(trial.variables[name].values, *grid))


def _expanded(trial, delay, basis, degree, grid):
    """Basis and inputs; methods that take the same ones share them."""
    position, rate = trial.variables["position"].values, float(trial.attrs["sampling_rate"])
    velocity = once(trial, ("velocity", delay), lambda: differentiate(position, rate, delay))
    motion = once(trial, ("motion", grid), lambda: _motion(position, grid, rate))

    def driven(fitted):
        return fitted, _inputs(motion, velocity, fitted, grid)

    if isinstance(basis, Basis):
        return driven(basis)
    return once(trial, ("inputs", delay, basis, degree, grid), lambda: driven(fit_basis(velocity, basis, degree)))


def shared_basis(trials, delay, basis, degree):
    """Basis settled on the velocities of several trials together, so that they can share a model.

    Parameters
    ----------
    trials : sequence of xarray.Dataset
        The trials.
    delay : float
        Reflex delay [s].
    basis : {"chebyshev", "rectifier", "spline"}
        Kind of basis.
    degree : int
        Number of its terms.

    Returns
    -------
    Basis
    """
    velocities = [
        differentiate(validate(trial)["position"].values, float(trial.attrs["sampling_rate"]), delay)
        for trial in trials
    ]
    return fit_basis(np.concatenate(velocities), basis, degree)


def share_channels(trials, signals, identification_rate, delay):
    """Decimate what methods need alike of several trials, each signal of all of them in one pass.

    Within `made_once`, `build_regressors` and the scores find it there.

    Parameters
    ----------
    trials : sequence of xarray.Dataset
        Trials of one length.
    signals : dict of str to ndarray, shape (trials, N)
        Their variables by name.
    identification_rate : float
        Rate of the identification [Hz].
    delay : float
        Reflex delay [s].

    Raises
    ------
    DataError
        For a sampling rate that is not a multiple of the rate, or trials that are too short.
    """
    grid = recording_grid(trials[0], identification_rate, delay)
    for name in SHARED & set(signals):
        for trial, values in zip(trials, decimate(signals[name], *grid), strict=True):
            once(trial, ("channel", name, grid), partial(np.asarray, values))
    rate = float(trials[0].attrs["sampling_rate"])
    for trial, *motion in zip(trials, *_motion(signals["position"], grid, rate), strict=True):
        once(trial, ("motion", grid), partial(list, motion))


def _inputs(motion, velocity, basis, grid):
    return np.column_stack([*motion, *decimate(basis(velocity), *grid)])


def _motion(position, grid, rate):
    return [decimate(position, *grid, rate=rate, derivative=d) for d in range(3)]


def inputs_of(position, trial, regressors, delay):
    """Inputs that another position would give, by the same basis and on the same samples.

    Parameters
    ----------
    position : ndarray, shape (samples,)
        Position at the recording rate [rad].
    trial : xarray.Dataset
        The trial.
    regressors : Regressors
        Its regressors.
    delay : float
        Reflex delay [s].

    Returns
    -------
    ndarray, shape (N, 3 + k)
    """
    rate = float(trial.attrs["sampling_rate"])
    velocity = differentiate(position, rate, delay)
    grid = recording_grid(trial, regressors.rate, delay)
    return _inputs(_motion(position, grid, rate), velocity, regressors.basis, grid)


def predicted_inputs(trial, regressors, delay):
    """Inputs as they would be without fed-back noise: rebuilt from the position that the reference explains.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    regressors : Regressors
        Its regressors, with a reference.
    delay : float
        Reflex delay [s].

    Returns
    -------
    ndarray, shape (N, 3 + k)
        Instruments for the inputs, on the same samples.

    Raises
    ------
    DataError
        If there is no reference.
    """
    if regressors.reference is None:
        raise DataError("instruments are made of the reference, and the trial has none.")
    if regressors.reference_name == "position":  # an open-loop record: the reference explains all of it
        return regressors.inputs
    source = trial[regressors.reference_name].values
    grid = recording_grid(trial, regressors.rate, delay)
    predicted = explained_by(regressors.inputs[:, 0], source, grid, float(trial.attrs["sampling_rate"]))
    return inputs_of(predicted, trial, regressors, delay)


def decimated(trial, name, time, identification_rate):
    """A variable of a trial at the samples of an estimate, through the decimation that the estimate's data had.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    name : str
        Variable.
    time : ndarray, shape (N,)
        Regular times of an estimate [s].
    identification_rate : float
        Rate of the estimate [Hz].

    Returns
    -------
    ndarray, shape (N,)

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> decimated(simulate(seed=1, duration=5.0), "torque", np.array([1.0, 1.01, 1.02]), 100.0).shape
    (3,)
    """
    rate = float(trial.attrs["sampling_rate"])
    factor = decimation_factor(rate, identification_rate)
    first = round((float(time[0]) - float(trial.variables["time"].values[0])) * rate)
    return _channel(trial, name, (factor, first, time.size))
