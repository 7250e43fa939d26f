"""The equations of an ensemble: columns of derivatives within the window, instruments and weights.

The filters of the channels and the dynamics of the reflex are matrices that act on a whole window.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import linalg
from scipy.fft import irfft, next_fast_len, rfft

from ankleloop.joint.dynamics import GRIDS
from ankleloop.methods.ensemble.options import EnsembleOptions
from ankleloop.methods.ensemble.windows import (
    CHANNEL_BAND,
    VELOCITY_BAND,
    Windows,
    filter_margin,
)
from ankleloop.methods.method import NOMINAL_DELAY
from ankleloop.methods.riv.equations import Parameters
from ankleloop.signals.decimation import convolve_strided, design_lowpass
from ankleloop.signals.least_squares import SINGULAR, fit_scaled

FOLDS = 10  # of the trials: the weights of each come from the others
POWER_FLOOR = 1e-9  # of the largest variance of the residual in a direction
RESPONSE = 4.0  # s, beyond a window: within it the slowest reflex of the grid has ended


class EnsembleEquations:
    """Filtered torque and inputs of all trials, and the equations between them.

    Columns are the derivatives of the torque by the unknowns, of shape (unknowns, trials, T).
    """

    def __init__(self, windows: Windows, options: EnsembleOptions, *, offsets: bool) -> None:
        self.windows = windows
        self.options = options
        self.delay = NOMINAL_DELAY if options.delay is None else options.delay
        rate = windows.rate
        margin = filter_margin(rate)
        # Whatever is held before the data is the same for all trials; what is held behind them is not used.
        position = np.pad(windows.position, ((0, 0), (margin, margin)), mode="edge")
        position -= windows.position.mean()
        torque = np.pad(windows.torque, ((0, 0), (margin, margin)), mode="edge")
        samples = position.shape[1]
        size = next_fast_len(samples + round(RESPONSE * rate), real=True)
        self.size = size
        self.s = 2j * np.pi * np.fft.rfftfreq(size, 1.0 / rate)
        taps, half = design_lowpass(rate, *CHANNEL_BAND)
        self.lowpass = rfft(np.roll(np.pad(taps, (0, size - taps.size)), -half))
        # Shape (T, samples): lag of each sample that is used behind each that there is.
        self.lags = (windows.rows[:, None] + margin - np.arange(samples)) % size
        self.torque = self._filter(self.lowpass[None], torque)[0]
        motion = self._filter(self.lowpass * self.s ** np.arange(3)[:, None], position)
        since = windows.time - options.moment
        self.intrinsic = np.concatenate([motion, (since * motion[0])[None]])
        if not options.slope:
            self.intrinsic = motion
        taps, half = design_lowpass(rate, *VELOCITY_BAND, derivative=1)
        velocity = convolve_strided(
            np.pad(position, ((0, 0), (half, half)), mode="edge"), taps, 0, 1, samples
        )
        self.rectified = np.maximum(velocity, 0.0)
        members = windows.groups == np.arange(1, windows.sizes.size)[:, None]
        offset_columns = np.repeat(members[:, :, None], windows.rows.size, axis=2).astype(float)
        self.offsets = offset_columns if offsets else offset_columns[:0]

    def _filter(self, spectra: np.ndarray, signals: np.ndarray) -> np.ndarray:
        """Signals from rest through filters, at the samples that are used.

        Shapes: spectra (filters, frequencies), signals (trials, samples); returns (filters, trials, T).
        """
        matrices = irfft(spectra, self.size)[:, self.lags]
        return signals @ np.swapaxes(matrices, 1, 2)

    def columns(self, parameters: Parameters) -> np.ndarray:
        """Derivatives of the torque by all unknowns, those of the offsets last."""
        intrinsic = len(self.intrinsic)
        drive = (self.lowpass * np.exp(-self.s * self.delay))[None]
        unused = np.zeros((intrinsic, self.s.size))
        spectra = parameters.differentiate(unused, drive, self.s)[intrinsic:]
        return np.concatenate([self.intrinsic, self._filter(spectra, self.rectified), self.offsets])

    def find_start(self) -> tuple[Parameters, np.ndarray]:
        """Best of a grid of dynamics for the differences of the means of the conditions; offsets, shape (C - 1,)."""
        windows = self.windows
        whitening = whiten(self.torque, windows.groups)
        target = (self._contrast(self.torque) @ whitening).ravel()
        delays = ("delay",) if self.options.delay is None else ()
        smallest = np.inf
        for dynamics in GRIDS[2]:
            unit = Parameters(
                np.append(np.zeros(len(self.intrinsic)), 1.0), dynamics, delays=delays
            )
            size = unit.linear.size
            columns = np.concatenate([self.columns(unit)[:size], self.offsets])
            rows = (self._contrast(columns) @ whitening).reshape(len(columns), -1).T
            values = fit_scaled(rows, target, SINGULAR)
            left = np.sum((target - rows @ values) ** 2)
            if left < smallest:
                smallest = left
                linear, offsets = np.split(values, [size])
                best = replace(unit, linear=linear)
        return best, offsets

    def _contrast(self, signals: np.ndarray) -> np.ndarray:
        """Means of the conditions less that of all trials, as they weigh.

        Shapes: signals (..., trials, T); returns (..., C, T).
        """
        means = self.windows.average(signals) - signals.mean(axis=-2, keepdims=True)
        return np.sqrt(self.windows.sizes)[:, None] * means

    def make_instruments(self, columns: np.ndarray) -> np.ndarray:
        """Means of columns over the other trials of the condition, less those over all other trials.

        No trial is its own instrument, and at each time the sum over the trials is zero.

        Shapes: columns (unknowns, trials, T); returns as columns.
        """
        windows = self.windows
        sums = windows.average(columns) * windows.sizes[:, None]
        members = windows.sizes[windows.groups][:, None]
        own = (sums[:, windows.groups] - columns) / (members - 1.0)
        total = columns.sum(axis=1, keepdims=True)
        return own - (total - columns) / (columns.shape[1] - 1.0)

    def find_weights(self, residual: np.ndarray) -> np.ndarray:
        """Whitening matrix of each trial, by the covariance of the residual in the trials of the other folds.

        Each condition is spread evenly over the folds.

        Shapes: residual (trials, T); returns (trials, T, T).
        """
        groups = self.windows.groups
        order = np.argsort(groups, kind="stable")
        folds = np.empty(order.size, int)
        folds[order] = np.arange(order.size) % FOLDS
        others = [folds != fold for fold in range(FOLDS)]
        matrices = np.array([whiten(residual[rest], groups[rest]) for rest in others])
        return matrices[folds]


def whiten(residual: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Matrix by which a residual of trials becomes white over the window.

    Its covariance is that within the conditions, on which a wrong model has little influence. The fewer trials there
    are, the more it is shrunk to one that has the directions of stationary noise, those of its Toeplitz part, which
    need not be positive itself, with the variances along them. The matrix is symmetric, so that means over trials of
    several folds are means of the same thing.

    Shapes: residual (trials, T), groups (trials,); returns (T, T).
    """
    trials, samples = residual.shape
    members = groups == np.unique(groups)[:, None]
    means = members @ residual / members.sum(axis=1, keepdims=True)
    deviations = residual - members.T @ means
    covariance = deviations.T @ deviations / (trials - len(members))
    diagonals = [covariance.diagonal(lag).mean() for lag in range(samples)]
    directions = np.linalg.eigh(linalg.toeplitz(diagonals))[1]
    variances = np.sum(directions * (covariance @ directions), axis=0)
    share = samples / (samples + trials)
    shrunk = (1.0 - share) * covariance + share * (directions * variances) @ directions.T
    values, vectors = np.linalg.eigh(shrunk)
    scales = np.sqrt(np.maximum(values, POWER_FLOOR * values[-1]))
    return (vectors / scales) @ vectors.T
