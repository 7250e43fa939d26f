"""K, B and G of a simulated joint over time, and the cycles or the scheduling variable that they vary with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ankleloop.simulation.settings import SimulationSettings

GOLDEN_RATIO = 0.5 * (np.sqrt(5.0) - 1.0)  # ratio of two periods that have no common multiple
# Settings with the means of the parameters that can vary.
MEANS = {"stiffness": "stiffness", "viscosity": "viscosity", "gain": "reflex_gain"}
# Amplitude and phase [rad] of the locked torque.
LOCKED_HARMONICS = {1: (1.0, 0.0), 2: (0.6, 1.0), 3: (0.3, 2.0)}


class Trajectories(NamedTuple):
    """Stiffness [N·m/rad], viscosity [N·m·s/rad] and reflex gain [N·m·s/rad] over time, each of shape (N,)."""

    stiffness: np.ndarray
    viscosity: np.ndarray
    gain: np.ndarray


@dataclass(frozen=True, eq=False)
class Course:
    """Where a trial is, at each time, within what its joint varies with."""

    settings: SimulationSettings  # settings of the simulation
    # Shape (cycles + 1,): start of every cycle [s], from before the settling time to after the end of the record,
    # which begins at 0.
    onsets: np.ndarray
    angles: np.ndarray  # shape (2,): phases of the two sinusoids of the scheduling variable [rad]

    def cycle(self, time: np.ndarray) -> np.ndarray:
        """Numbers of the cycles from 0, shape of `time`."""
        next_onset = np.searchsorted(self.onsets, time + 1e-9, side="right")
        return np.clip(next_onset - 1, 0, self.onsets.size - 2)

    def phase(self, time: np.ndarray) -> np.ndarray:
        """Phase of the cycle, from 0 to 1, shape of `time`."""
        cycle = self.cycle(time)
        durations = np.diff(self.onsets)
        return np.clip((time - self.onsets[cycle]) / durations[cycle], 0.0, 1.0)

    def schedule(self, time: np.ndarray) -> np.ndarray:
        """Scheduling variable, from 0 to 1, shape of `time`."""
        periods = self.settings.schedule_period * np.array([1.0, GOLDEN_RATIO])
        sinusoids = np.sin(2 * np.pi * time[:, None] / periods + self.angles)
        return 0.5 + 0.25 * np.sum(sinusoids, axis=1)

    def place(self, time: np.ndarray) -> np.ndarray:
        """Place within 0 … 1 of what K, B and G vary with, shape of `time`."""
        if self.settings.variation == "cycle":
            return self.phase(time)
        if self.settings.variation == "schedule":
            return self.schedule(time)
        return np.clip(time / self.settings.duration, 0.0, 1.0)

    def movement(self, time: np.ndarray) -> np.ndarray:
        """Slow command [rad], shape of `time`."""
        amplitude = self.settings.movement
        if self.settings.variation == "schedule":
            return amplitude * (self.schedule(time) - 0.5)
        return 0.5 * amplitude * np.sin(2 * np.pi * self.phase(time))

    def locked_torque(self, time: np.ndarray) -> np.ndarray:
        """Torque of unit standard deviation that repeats with the cycle, shape of `time`."""
        phase = 2 * np.pi * self.phase(time)
        harmonics = [
            amplitude * np.sin(number * phase + angle)
            for number, (amplitude, angle) in LOCKED_HARMONICS.items()
        ]
        power = 0.5 * sum(amplitude**2 for amplitude, _ in LOCKED_HARMONICS.values())
        return np.sum(harmonics, axis=0) / np.sqrt(power)


def draw_course(settings: SimulationSettings, rng: np.random.Generator) -> Course:
    """Draw durations of cycles and the scheduling variable of a trial."""
    angles = rng.uniform(0.0, 2.0 * np.pi, 2)
    mean = settings.cycle_duration
    jitter = settings.cycle_jitter
    before = int(np.ceil(settings.settling / mean - 1e-9))
    shortest = mean * (1.0 - jitter)
    count = int(np.ceil((before * mean + settings.duration) / shortest - 1e-9))
    durations = mean * (1.0 + jitter * rng.uniform(-1.0, 1.0, count))
    onsets = -mean * before + np.concatenate([[0.0], np.cumsum(durations)])
    last = np.searchsorted(onsets, settings.duration - 1e-9)
    return Course(settings, onsets[: last + 1], angles)


def trajectories(course: Course, time: np.ndarray) -> Trajectories:
    """K, B and G at some times.

    Shapes: time (N,).
    """
    place = course.place(time)
    return Trajectories(*(_profile(course.settings, name, place) for name in MEANS))


def parameter_ranges(settings: SimulationSettings) -> np.ndarray:
    """Smallest and largest value of stiffness, viscosity and gain, shape (3, 2)."""
    ranges = []
    for name in MEANS:
        mean, share, table = _variation(settings, name)
        values = [mean * (1 - share), mean * (1 + share)] if table is None else table
        ranges.append([min(values), max(values)])
    return np.array(ranges)


def _variation(
    settings: SimulationSettings, name: str
) -> tuple[float, float, tuple[float, ...] | None]:
    """Mean of a parameter, its relative variation, and its table."""
    mean = getattr(settings, MEANS[name])
    return mean, getattr(settings, f"{name}_variation"), getattr(settings, f"{name}_table")


def _profile(settings: SimulationSettings, name: str, place: np.ndarray) -> np.ndarray:
    """Values of a parameter at places within 0 … 1."""
    mean, share, table = _variation(settings, name)
    if table is not None:
        is_cycle = settings.variation == "cycle"  # whose first value follows the last one
        values = [*table, table[0]] if is_cycle else table
        return np.interp(place, np.linspace(0.0, 1.0, len(values)), values)
    if share == 0:
        return np.full(place.size, mean)
    peak = getattr(settings, f"{name}_peak")
    wave = np.cos(2 * np.pi * (place - peak))
    if settings.variation_shape == "square":
        wave = np.where(wave > 0, 1.0, -1.0)
    return mean * (1.0 + share * wave)
