"""What commands tell of a joint with its load before anything is recorded, all of them under the same disturbance."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ankleloop.assessment.cramer_rao import (
    QUIET_SETTINGS,
    disturbance_spectrum,
    fisher_information,
    parameter_variances,
)
from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.methods.riv.equations import NOISE_RESOLUTION
from ankleloop.options import show_value
from ankleloop.quantities import SETTINGS, STIFFNESS
from ankleloop.signals.spectra import pass_band
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.simulate import draw_perturbation, simulate

# Settings of a simulation by the parameters of an estimate.
JOINT_SETTINGS = SETTINGS | {"pole": "pole"}
IDENTIFICATION_RATE = 100.0  # Hz
LOST_TIME = 0.66  # s of a record: its ends, which the filters of the identification touch
LONGEST_RECORD = 3600.0  # s


def describe_joint(
    owner: str, joint: Estimate | Mapping[str, Any], others: Mapping[str, Any]
) -> SimulationSettings:
    """Settings of a joint and its experiment; what an estimate does not hold (load, servo, recorder) is in `others`."""
    if isinstance(joint, Estimate):
        warn_of_pilot(owner, joint)
        parameters = {**joint.stiffness, **joint.reflex}
        values = {
            setting: parameters[name]
            for name, setting in JOINT_SETTINGS.items()
            if name in parameters
        }
        if not {*STIFFNESS} <= {*parameters}:
            missing = " ".join(joint.diagnostics["missing"])
            raise DataError(f"the pilot has to show K, B and I. {missing}")
        if "omega_n" not in parameters:  # a passive joint, whose G is zero within its interval
            values["reflex_gain"] = 0.0
        elif "G" not in parameters:
            missing = " ".join(joint.diagnostics["missing"])
            raise DataError(f'{missing} Identify the pilot with basis="rectifier".')
    elif isinstance(joint, Mapping):
        values = dict(joint)
    else:
        raise TypeError(
            f"{owner}: joint must be an estimate or settings of simulate by name, got {show_value(joint)}."
        )
    settings = SimulationSettings.parse(owner, **{**values, **others})
    if isinstance(joint, Mapping) and not settings.disturbed:
        raise ValueError(
            f"{owner}: without a disturbance every record is exact: set snr_db or voluntary."
        )
    return settings


def warn_of_pilot(owner: str, pilot: Estimate) -> None:
    """Warn of what an estimate warns of: a plan is as good as its pilot."""
    texts = pilot.warnings
    if texts:
        advice = "the pilot has warnings; correct or repeat it first."
        warnings.warn(f"{owner}: {advice} {' '.join(texts)}", UserWarning, stacklevel=4)


@dataclass(frozen=True, eq=False)
class Experiment:
    """A joint with its load and servo, the disturbance of its torque, and limits of the perturbation."""

    settings: SimulationSettings  # without disturbances
    # Power spectral density of the disturbance over frequency [(N·m)²/Hz]: it does not change with the perturbation.
    spectrum: Callable[[np.ndarray], np.ndarray]
    # Largest torque [N·m], largest velocity of the servo and mean velocity of the joint [rad/s], as far as limited.
    limits: Mapping[str, float]

    @classmethod
    def of(
        cls,
        joint: Estimate | Mapping[str, Any],
        settings: SimulationSettings,
        limits: Mapping[str, float],
        seed: int,
    ) -> Experiment:
        """The experiment, with voluntary torque and noise relative to the torque that its own perturbation causes."""
        quiet = cls(settings.model_copy(update=QUIET_SETTINGS), np.ones_like, limits)
        if isinstance(joint, Estimate):
            return replace(quiet, spectrum=_pilot_spectrum(joint))
        level = settings.torque_level
        if level is None:
            torques = [quiet.respond(command).samples["torque"] for command in quiet.draw({}, seed)]
            level = float(np.sqrt(np.mean(np.var(torques, axis=1))))
        spectrum = partial(disturbance_spectrum, level=level, settings=settings)
        return replace(quiet, spectrum=spectrum)

    def change(self, **settings: Any) -> Experiment:
        """The experiment with other settings, under the same disturbance."""
        return replace(self, settings=self.settings.model_copy(update=settings))

    def respond(self, command: np.ndarray) -> PreparedTrial:
        """The trial of a command [rad] without disturbances."""
        return prepare(simulate(seed=0, command=command, **dict(self.settings)))

    def limit(self, command: np.ndarray) -> np.ndarray:
        """A command within the limits: the loop is positively homogeneous, so a smaller command scales all signals."""
        if not self.limits:
            return command
        clean = self.respond(command)
        sizes = {
            "torque": largest_magnitude(clean.samples["torque"]),
            "joint_velocity": mean_speed(clean),
        }
        if "servo_velocity" in self.limits:
            servo = self.change(closed_loop=False).respond(command)
            sizes["servo_velocity"] = largest_magnitude(servo.velocity(0.0))
        factors = [limit / sizes[name] for name, limit in self.limits.items()]
        return min(1.0, *factors) * command

    def draw(
        self, perturbation: Mapping[str, Any], *seeds: int, count: int = 8
    ) -> list[np.ndarray]:
        """Commands of some settings of the perturbation, within the limits [rad]; shapes (samples,)."""
        settings = self.settings.model_copy(update=perturbation)
        samples = round(settings.duration * settings.recording_rate)
        streams = [np.random.default_rng([*seeds, number]) for number in range(count)]
        return [self.limit(draw_perturbation(settings, stream, samples)) for stream in streams]

    def variances(self, commands: Iterable[np.ndarray]) -> dict[str, float]:
        """Variance of every parameter by `riv` from a record with such a command: its noise spectrum is an estimate."""
        parts = []
        for command in commands:
            names, information = fisher_information(
                self.respond(command), self.settings, fed_back=False, spectrum=self.spectrum
            )
            parts.append(information)
        variances = parameter_variances(names, np.mean(parts, axis=0))
        samples = round((self.settings.duration - LOST_TIME) * IDENTIFICATION_RATE)
        band = pass_band(samples, IDENTIFICATION_RATE)
        # As in `asymptotic_covariance`.
        factor = 1.0 + 2.0 * band.smoothing_variance(NOISE_RESOLUTION)
        return {name: factor * variance for name, variance in variances.items()}


def largest_magnitude(x: np.ndarray) -> float:
    """Largest magnitude of a signal."""
    return float(np.max(np.abs(x)))


def mean_speed(trial: PreparedTrial) -> float:
    """Mean speed of the joint [rad/s]."""
    return float(np.mean(np.abs(trial.velocity(0.0))))


def _pilot_spectrum(pilot: Estimate) -> Callable[[np.ndarray], np.ndarray]:
    """Spectrum of the disturbance that a pilot estimates."""
    density = pilot.diagnostics.get("noise_spectrum")
    if density is None:
        raise DataError(
            f"{pilot.method} estimates no spectrum of the noise: identify the pilot by riv."
        )
    band = pass_band(pilot.torque.sizes["time"], pilot.torque.attrs["identification_rate"])
    # The inverse of a periodogram that scatters is on average larger than that of the spectrum.
    unbiased = density * (1.0 + band.smoothing_variance(NOISE_RESOLUTION))
    points = pilot.diagnostics["noise_frequency"]
    return lambda frequency: np.interp(frequency, points, unbiased)
