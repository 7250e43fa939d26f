"""The equations of `riv-tv`: whitened regressors and instruments, less what repeats with the cycle."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.time_varying_course import make_course
from ankleloop.methods.method import NOMINAL_DELAY
from ankleloop.methods.riv.equations import DELAY_LIMITS, Parameters
from ankleloop.methods.riv_tv.bases import Bases
from ankleloop.methods.riv_tv.motion import (
    Motion,
    join_positions,
    measure_motion,
    predict_motion,
)
from ankleloop.methods.riv_tv.options import RivTvOptions
from ankleloop.methods.riv_tv.repetition import CycleMean, SmoothPart
from ankleloop.methods.riv_tv.whitening import NoiseModel, PaddedTransform, Weighting


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of the model that a motion makes, times the splines of their parameters: spectra less what repeats."""

    motion: Motion
    intrinsic: np.ndarray  # shape (splines of K, B and I, frequencies)
    drive: np.ndarray  # shape (splines of G, frequencies): of the reflex, for a delay


class WhitenedSystem:
    """Whitened equations at some parameters."""

    def __init__(self, instruments: np.ndarray, regressors: np.ndarray, torque: np.ndarray) -> None:
        # Shape (unknowns, rows): derivatives of the torque with respect to the unknowns, by the predicted inputs and by
        # the measured ones.
        self.instruments = instruments
        self.regressors = regressors
        self.torque = torque  # shape (rows,)
        self.normal = instruments @ regressors.T
        self.side = instruments @ torque
        self.information = instruments @ instruments.T

    def residual(self, linear: np.ndarray) -> np.ndarray:
        """Whitened torque less that of linear parameters, shape (rows,)."""
        return self.torque - linear @ self.regressors[: linear.size]


class TimeVaryingEquations:
    """Spectra of torque and inputs of trials for a delay of the reflex; whitened systems are made of them.

    The instruments are made of the position that the reference predicts; the position itself as reference gives least
    squares.
    """

    def __init__(self, trials: Sequence[PreparedTrial], options: RivTvOptions) -> None:
        self.options = options
        self.delay = NOMINAL_DELAY if options.delay is None else options.delay  # [s]
        latest = DELAY_LIMITS[1] if options.delay is None else options.delay
        self.trials = trials
        self.grids = [trial.grid(options.identification_rate, latest) for trial in trials]
        self.course = make_course(trials, self.grids, options.cycle_onsets, options.schedule)
        self.bases = Bases(options, self.course)
        sizes = [grid.samples for grid in self.grids]
        self.transform = PaddedTransform(sizes, trials[0].rate / self.grids[0].factor)
        self.noise = NoiseModel(self.course, self.transform, options.weighting)
        self.smooth_part = SmoothPart.of(self.course, self.transform)
        self.repeated: CycleMean | SmoothPart = self.smooth_part
        if self.course.equal_cycles:
            self.repeated = CycleMean.of(self.course)
        # Without these equations, which would refer to themselves, and stay in memory.
        signals = self.transform.signals
        rows = self.course.rows
        self._unweighted = self.whitener(lambda spectra: signals(spectra)[..., rows])
        torques = [torque - torque.mean() for torque in self._channels("torque")]
        self.torque = self.spectra(np.concatenate(torques))
        positions = join_positions(trials, self.grids)
        slow = self.smooth_part.part(positions)
        motion = measure_motion(trials, self.grids, positions - slow)
        self.measured = self._make_inputs(motion)
        self.predicted = self.measured
        self.reference = np.zeros(0)  # spectrum; none where the position is the reference
        if options.reference != "position":
            reference = self.find_reference()
            self.reference = self.spectra(reference)
            factor = self.grids[0].factor
            predicted = predict_motion(motion, slow, reference, self.transform, factor)
            self.predicted = self._make_inputs(predicted)

    def _channels(self, name: str) -> list[np.ndarray]:
        """A variable of each trial, decimated."""
        pairs = zip(self.trials, self.grids, strict=True)
        return [trial.channel(name, grid) for trial, grid in pairs]

    def find_reference(self) -> np.ndarray:
        """Reference less what of it repeats or changes slowly, shape (N,)."""
        channels = self._channels(self.options.reference)
        return self.smooth_part.deviation(np.concatenate(channels))

    @property
    def open_loop(self) -> bool:
        """Whether the position is its own reference."""
        return self.predicted is self.measured

    def spectra(self, signals: np.ndarray) -> np.ndarray:
        """Transforms of signals less what repeats with the cycle, or changes slowly.

        What repeats is far larger than what does not. It goes before any filter, whose response to the ends of the
        record would reach into the samples that count.

        Shapes: signals (..., N); returns (..., frequencies).
        """
        return self.transform.spectra(self._centre(self.repeated.deviation(signals)))

    def _centre(self, signals: np.ndarray) -> np.ndarray:
        """Signals less the mean of each of several trials; that of a single one is among what changes slowly."""
        if not self.course.trials:
            return signals
        pairs = zip(self.transform.split(signals), self.course.trials, strict=True)
        centred = [
            trial - trial[..., part.rows].mean(axis=-1, keepdims=True) for trial, part in pairs
        ]
        return np.concatenate(centred, axis=-1)

    def _make_inputs(self, motion: Motion) -> Inputs:
        """Inputs that a motion makes."""
        splines = self.bases.values
        products = [
            splines["K"] * motion.position,
            splines["B"] * motion.velocity,
            splines["I"] * motion.acceleration,
        ]
        return Inputs(motion, self.spectra(np.vstack(products)), self._make_drive(motion))

    def _make_drive(self, motion: Motion) -> np.ndarray:
        """Inputs of the reflex: a delay that acts behind the splines would move G over phase."""
        return self.spectra(self.bases.values["G"] * motion.rectify(self.delay))

    def with_delay(self, delay: float) -> TimeVaryingEquations:
        """The equations for another delay of the reflex."""
        changed = copy(self)
        changed.delay = delay
        changed.measured = replace(self.measured, drive=changed._make_drive(self.measured.motion))
        changed.predicted = changed.measured
        if not self.open_loop:
            changed.predicted = replace(
                self.predicted, drive=changed._make_drive(self.predicted.motion)
            )
        return changed

    def lead(self, parameters: Parameters) -> np.ndarray:
        """Transform of the torque, ahead by its lag."""
        if not parameters.lag:
            return self.torque
        return self.torque * np.exp(self.transform.s * parameters.lag)

    def whitener(self, weighting: Weighting) -> Weighting:
        """Whitener with some weights."""
        repeated = self.repeated.weighted(weighting)
        return lambda spectra: repeated.deviation(weighting(spectra))

    def noise_whitener(self, parameters: Parameters) -> Weighting:
        """Whitener of the noise: the residual torque less what repeats with the cycle."""
        inputs = self.measured
        explained = parameters.torque(inputs.intrinsic, inputs.drive, self.transform.s)
        residual = self._unweighted(self.lead(parameters) - explained)
        return self.whitener(self.noise.whiten(residual))

    def system(self, parameters: Parameters, whitener: Weighting) -> WhitenedSystem:
        """Whitened system at some parameters."""
        sides = [self.measured] if self.open_loop else [self.measured, self.predicted]
        derivatives = [
            whitener(parameters.differentiate(inputs.intrinsic, inputs.drive, self.transform.s))
            for inputs in sides
        ]
        return WhitenedSystem(
            instruments=derivatives[-1],
            regressors=derivatives[0],
            torque=whitener(self.lead(parameters)),
        )
