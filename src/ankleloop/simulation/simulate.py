"""A simulated experiment: from settings and a seed to a trial with its true torques."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ankleloop.errors import UnstableLoopError
from ankleloop.options import as_plain, check_memory, show_fields, show_value
from ankleloop.simulation.filters import VOLUNTARY_WARMUP, antialias, voluntary_filter
from ankleloop.simulation.loop import build_loop, run_loop
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import Course, Trajectories, draw_course, trajectories
from ankleloop.trials.trial import new_trial

HELD_VALUES = 100  # values of noise over which the anti-aliasing filter settles
TRIAL_ARRAYS = 16  # arrays over all samples of a trial that are in memory at a time, at least


@show_fields(SimulationSettings)
def simulate(*, seed: int | np.random.SeedSequence, load: Sequence[float] | None = None, **settings: Any) -> xr.Dataset:
    r"""Simulate a trial of the parallel-cascade joint against a compliant load.

    Position = servo(reference) − H_imp(s)·(intrinsic + reflex + voluntary + noise torque), Figure 2 and Section IV of
    Zhao, Ludvig and Kearney (ACC 2008), with

    .. math:: TQ_I = K P + B \dot P + I \ddot P, \qquad
              TQ_R = \frac{G\,\omega_n^2}{s^2 + 2\zeta\omega_n s + \omega_n^2} \max(0, \dot P(t - \tau)).

    The noise level refers to the clean net torque, that of the same seed without noise, voluntary torque and movement.

    With `variation`, K, B and G vary with the phase of a cycle, with time or with a scheduling variable. G multiplies
    the rectified velocity, before the low-pass: it is the gain at the time when the muscle is excited.

    Parameters
    ----------
    seed : int or numpy.random.SeedSequence
        The same seed gives the same bits; perturbation, voluntary torque and noise have separate streams, so a change
        of one setting does not change the other signals.
    load : sequence of float, optional
        Inertia [kg·m²], viscosity [N·m·s/rad] and stiffness [N·m/rad] of the load together, instead of the settings
        `load_inertia`, `load_viscosity` and `load_stiffness`.
    **settings
        Settings by name; `SimulationSettings` describes each of them with its unit, default and bounds.

    Returns
    -------
    xarray.Dataset
        A trial with `position`, `torque`, `reference` and the truths `torque_intrinsic`, `torque_reflex`,
        `torque_voluntary`, `torque_noise`, all behind the same anti-aliasing filter. With `variation`, a movement or a
        locked torque there is `phase`, the phase of the cycle, or `schedule`, the scheduling variable; with `variation`
        the true `stiffness_true`, `viscosity_true` and `reflex_gain_true` as well. The settings are attributes.

    Raises
    ------
    UnstableLoopError
        If the loop diverges.
    TypeError
        For a name that is not a setting.
    ValueError
        For a value out of its bounds.

    Examples
    --------
    >>> trial = simulate(seed=1, duration=10.0)
    >>> trial.sizes["time"]
    10000
    """
    all_settings = SimulationSettings.parse("simulate", load=load, **settings)
    remedy = "take a shorter duration or settling, a lower recording_rate, or a higher voluntary_cutoff or noise_rate"
    check_memory("simulate", _count_bytes(all_settings), remedy)
    return _simulate(all_settings, _check_seed(seed))


def _count_bytes(settings: SimulationSettings) -> float:
    """Memory that one trial needs at least: its signals, the start of the voluntary torque, and one held noise value.

    The last two are in memory while their powers are computed.
    """
    rate = settings.recording_rate
    samples = TRIAL_ARRAYS * (settings.duration + settings.settling) * rate
    if settings.voluntary > 0:
        samples += 4 * VOLUNTARY_WARMUP * rate / settings.voluntary_cutoff
    if settings.snr_db is not None:
        samples += 3 * HELD_VALUES * rate / settings.noise_rate
    return 8.0 * samples


class _Streams(NamedTuple):
    """Random generators of one trial, one for each signal."""

    perturbation: np.random.Generator
    voluntary: np.random.Generator
    noise: np.random.Generator
    course: np.random.Generator


class _Disturbance(NamedTuple):
    """A torque [N·m] that is fed back, and the same behind the anti-aliasing filter; shape (samples,)."""

    torque: np.ndarray
    record: np.ndarray


def _simulate(settings: SimulationSettings, seed: int | np.random.SeedSequence) -> xr.Dataset:
    settling = round(settings.settling * settings.recording_rate)
    samples = settling + round(settings.duration * settings.recording_rate)
    streams = _open_streams(seed)
    course = draw_course(settings, streams.course)
    time = np.arange(-settling, samples - settling) / settings.recording_rate
    varies = settings.variation is not None
    variation = trajectories(course, time + 0.5 / settings.recording_rate) if varies else None
    command = _draw_command(settings, streams.perturbation, course, time)
    silence = _Disturbance(np.zeros(samples), np.zeros(samples))
    response = _run_stable_loop(settings, command, silence, silence, variation)
    voluntary = noise = silence
    deviation = float(np.std((response[1] + response[2])[settling:]))
    if settings.voluntary > 0 or settings.locked_torque > 0:
        voluntary = _draw_voluntary(settings, streams, course, time, deviation)
    if settings.snr_db is not None:
        noise = _draw_measurement_noise(settings, streams, samples, 10 ** (-settings.snr_db / 20) * deviation)
    if settings.movement > 0:
        command = command + course.movement(time)
    if voluntary is not silence or noise is not silence or settings.movement > 0:
        response = _run_stable_loop(settings, command, noise, voluntary, variation)
    signals = *response, voluntary.record, noise.record, antialias(command, settings, "zoh")
    truths = _describe_course(course, time[settling:])
    return _make_trial(settings, seed, truths, *(signal[settling:] for signal in signals))


def _describe_course(course: Course, time: np.ndarray) -> dict[str, np.ndarray]:
    """Variables of a trial whose parameters vary, or that moves: phase or scheduling variable, and true K, B and G."""
    settings, variables = course.settings, {}
    if settings.variation == "schedule":
        variables["schedule"] = course.schedule(time)
    elif settings.variation == "cycle" or settings.perturbation_locked or settings.locked_torque or settings.movement:
        variables["phase"] = course.phase(time)
    if settings.variation is not None:
        truth = trajectories(course, time)
        variables |= {
            "stiffness_true": truth.stiffness,
            "viscosity_true": truth.viscosity,
            "reflex_gain_true": truth.gain,
        }
    return variables


def _make_trial(
    settings: SimulationSettings,
    seed: int | np.random.SeedSequence,
    truths: dict[str, np.ndarray],
    position: np.ndarray,
    intrinsic: np.ndarray,
    reflex: np.ndarray,
    voluntary: np.ndarray,
    noise: np.ndarray,
    reference: np.ndarray,
) -> xr.Dataset:
    """Trial of recorded signals, with its seed and settings as attributes."""
    attributes = {name: _as_attribute(value) for name, value in settings}
    return new_trial(
        position,
        intrinsic + reflex + voluntary + noise,
        settings.recording_rate,
        reference,
        torque_intrinsic=intrinsic,
        torque_reflex=reflex,
        torque_voluntary=voluntary,
        torque_noise=noise,
        **truths,
        # As text where the entropy is too long for an integer of a file.
        seed=seed if isinstance(seed, int) and abs(seed) < 2**63 else str(_seed_sequence(seed)),
        **attributes,
    )


def _as_attribute(value: Any) -> Any:
    """A setting as a file can hold it: flags as numbers, tables as text."""
    if isinstance(value, tuple):
        return ", ".join(map(repr, value))
    return int(value) if isinstance(value, bool) else value


def _check_seed(seed: Any) -> int | np.random.SeedSequence:
    """Refuse what is no seed; None would not be reproducible."""
    plain = as_plain(seed)
    if isinstance(plain, np.random.SeedSequence) or (type(plain) is int and plain >= 0):
        return plain
    raise ValueError(
        f"simulate: seed must be a whole number of at least 0 or a numpy.random.SeedSequence, got {show_value(seed)}."
    )


def _seed_sequence(seed: int | np.random.SeedSequence) -> np.random.SeedSequence:
    return seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)


def _open_streams(seed: int | np.random.SeedSequence) -> _Streams:
    """Random generators of a trial.

    The keys of the child sequences are set here: `SeedSequence.spawn` counts its calls, so the same seed would give
    other bits the next time.
    """
    root = _seed_sequence(seed)
    keys = [(*root.spawn_key, k) for k in range(len(_Streams._fields))]
    return _Streams(*(np.random.default_rng(np.random.SeedSequence(root.entropy, spawn_key=key)) for key in keys))


def _draw_command(
    settings: SimulationSettings, rng: np.random.Generator, course: Course, time: np.ndarray
) -> np.ndarray:
    """Perturbation [rad], shape (samples,)."""
    interval = round(settings.switching_interval * settings.recording_rate)
    if settings.perturbation == "prbs":
        command = draw_prbs(rng, time.size, interval, settings.amplitude)
    else:
        length = round(settings.pulse_length * settings.recording_rate)
        command = draw_pulses(rng, time.size, interval, length, settings.amplitude)
    if not settings.perturbation_locked:
        return command
    # Each cycle begins with the first samples.
    onset = course.onsets[np.searchsorted(course.onsets, time + 1e-9, side="right") - 1]
    return command[np.round((time - onset) * settings.recording_rate).astype(int)]


def _draw_voluntary(
    settings: SimulationSettings, streams: _Streams, course: Course, time: np.ndarray, deviation: float
) -> _Disturbance:
    """Voluntary torque, at random and in step with the cycle, for a deviation [N·m] of the clean net torque."""
    torque = np.zeros(time.size)
    if settings.voluntary > 0:
        rate, cutoff = settings.recording_rate, settings.voluntary_cutoff
        torque = settings.voluntary * deviation * draw_voluntary_torque(streams.voluntary, time.size, rate, cutoff)
    if settings.locked_torque > 0:
        torque += settings.locked_torque * deviation * course.locked_torque(time)
    return _Disturbance(torque, antialias(torque, settings, "foh"))


def _draw_measurement_noise(
    settings: SimulationSettings, streams: _Streams, samples: int, deviation: float
) -> _Disturbance:
    """Measurement noise that has a standard deviation [N·m] behind the anti-aliasing filter."""
    hold = round(settings.recording_rate / settings.noise_rate)
    torque = deviation / _recorded_noise_deviation(settings, hold) * draw_noise(streams.noise, samples, hold)
    return _Disturbance(torque, antialias(torque, settings, "zoh"))


@lru_cache
def _recorded_noise_deviation(settings: SimulationSettings, hold: int) -> float:
    """Standard deviation, behind the anti-aliasing filter, of unit white noise that is held for some samples."""
    pulse = np.zeros(HELD_VALUES * hold)
    pulse[:hold] = 1.0
    return float(np.sqrt(np.sum(antialias(pulse, settings, "zoh") ** 2) / hold))


def _run_stable_loop(
    settings: SimulationSettings,
    command: np.ndarray,
    noise: _Disturbance,
    voluntary: _Disturbance,
    variation: Trajectories | None,
) -> np.ndarray:
    """Recorded position, intrinsic and reflex torque, shape (3, samples); a loop that diverges is an error."""
    loop = build_loop(settings)
    record, divergence = run_loop(loop, settings, command, noise.torque, voluntary.torque, variation)
    if divergence >= 0:
        raise UnstableLoopError(
            f"the closed loop is unstable: the position passes ±{settings.position_limit:g} rad after "
            f"{divergence / settings.recording_rate:.3g} s. "
            f"Parameters: load_inertia={settings.load_inertia:g} kg·m², load_viscosity={settings.load_viscosity:g} "
            f"N·m·s/rad, load_stiffness={settings.load_stiffness:g} N·m/rad, reflex_gain={settings.reflex_gain:g} "
            f"N·m·s/rad, delay={settings.delay:g} s, stiffness={settings.stiffness:g} N·m/rad, "
            f"viscosity={settings.viscosity:g} N·m·s/rad. "
            "Take a heavier or more damped load, or a lower reflex gain."
        )
    return record


def draw_prbs(rng: np.random.Generator, samples: int, interval: int, amplitude: float) -> np.ndarray:
    """Draw a pseudorandom binary sequence that switches at random multiples of an interval.

    Shapes: returns (samples,).
    """
    levels = rng.integers(0, 2, size=-(-samples // interval)) - 0.5
    return amplitude * np.repeat(levels, interval)[:samples]


def draw_pulses(rng: np.random.Generator, samples: int, interval: int, length: int, amplitude: float) -> np.ndarray:
    """Draw short pulses of independent random sign at random multiples of an interval, with zeros in between.

    A pulse ends before its reflex begins, and its sign is independent of the next one. So the position and its
    derivatives are uncorrelated with the reflex torque, except for the smearing by the actuator.

    Shapes: returns (samples,).
    """
    signs = rng.choice([-0.5, 0.0, 0.0, 0.5], size=-(-samples // interval))
    shape = (np.arange(interval) < length).astype(float)
    return amplitude * np.outer(signs, shape).ravel()[:samples]


def draw_voluntary_torque(rng: np.random.Generator, samples: int, rate: float, cutoff: float) -> np.ndarray:
    """Draw Gaussian noise through a second-order Bessel low-pass, of unit standard deviation.

    Shapes: returns (samples,).
    """
    system, warmup, deviation = voluntary_filter(rate, cutoff)
    return system.run(rng.standard_normal(warmup + samples))[warmup:] / deviation


def draw_noise(rng: np.random.Generator, samples: int, hold: int) -> np.ndarray:
    """Draw white Gaussian noise of unit standard deviation, each value of which is held for some samples.

    Shapes: returns (samples,).
    """
    return np.repeat(rng.standard_normal(-(-samples // hold)), hold)[:samples]
