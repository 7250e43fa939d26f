"""A simulated experiment: from settings and a seed to a trial with its true torques."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ankleloop.arguments import as_plain, check_memory, show_value
from ankleloop.errors import UnstableLoopError
from ankleloop.options import show_fields
from ankleloop.records.trial import new_trial
from ankleloop.simulation.excitation import draw_noise, draw_prbs, draw_pulses, draw_voluntary_torque
from ankleloop.simulation.filters import VOLUNTARY_WARMUP, antialias
from ankleloop.simulation.loop import Loop, build_loop, run_loop
from ankleloop.simulation.settings import SimulationSettings

__all__ = ["simulate", "simulate_trials"]

CHUNK = 16  # trials of one pass: more of them take memory and no less time
CHUNK_MEMORY = 2**28  # bytes of one pass, where the trials are long
HELD_VALUES = 100  # values of noise over which the anti-aliasing filter settles
TRIAL_ARRAYS = 16  # arrays over all samples of a trial that are in memory at a time, at least


@show_fields(SimulationSettings)
def simulate(*, seed: int | np.random.SeedSequence, load: Sequence[float] | None = None, **settings: Any) -> xr.Dataset:
    r"""Simulate a trial of the parallel-cascade joint against a compliant load.

    Position = servo(reference) − H_imp(s)·(intrinsic + reflex + voluntary + noise torque), Figure 2 and Section IV of
    Zhao, Ludvig and Kearney (ACC 2008), with

    .. math:: TQ_I = K P + B \dot P + I \ddot P, \qquad
              TQ_R = \frac{G\,\omega_n^2}{s^2 + 2\zeta\omega_n s + \omega_n^2} \max(0, \dot P(t - \tau)).

    The noise level refers to the clean net torque, that of the same seed without noise and voluntary torque.

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
        `torque_voluntary`, `torque_noise`, all behind the same anti-aliasing filter. The settings are attributes.

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
    return next(simulate_trials([seed], load=load, **settings))


@show_fields(SimulationSettings)
def simulate_trials(
    seeds: Iterable[int | np.random.SeedSequence], *, load: Sequence[float] | None = None, **settings: Any
) -> Iterator[xr.Dataset]:
    """Simulate trials that differ in their seeds alone, several in one pass.

    Parameters
    ----------
    seeds : iterable of int or numpy.random.SeedSequence
        Seed of each trial; it gives the same bits as `simulate` does.
    load, **settings
        As `simulate` takes them.

    Yields
    ------
    xarray.Dataset
        A trial.

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
    >>> [trial.attrs["seed"] for trial in simulate_trials([3, 4], duration=2.0)]
    [3, 4]
    """
    all_settings = SimulationSettings.parse("simulate", load=load, **settings)
    size = _count_bytes(all_settings)
    remedy = "take a shorter duration or settling, a lower recording_rate, or a higher voluntary_cutoff or noise_rate"
    check_memory("simulate", size, remedy)
    trials = min(CHUNK, max(1, int(CHUNK_MEMORY // size)))
    loop, remaining = build_loop(all_settings), map(_check_seed, seeds)
    while chunk := list(islice(remaining, trials)):
        yield from _simulate_chunk(all_settings, loop, chunk)


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


class _Disturbance(NamedTuple):
    """A torque [N·m] that is fed back, and the same behind the anti-aliasing filter; shape (trials, samples)."""

    torque: np.ndarray
    record: np.ndarray


def _simulate_chunk(
    settings: SimulationSettings, loop: Loop, seeds: Sequence[int | np.random.SeedSequence]
) -> Iterator[xr.Dataset]:
    """Simulate one trial for each seed, all of them in one pass over every signal."""
    settling = round(settings.settling * settings.recording_rate)
    samples = settling + round(settings.duration * settings.recording_rate)
    streams = [_open_streams(seed) for seed in seeds]
    command = np.stack([_draw_command(settings, stream.perturbation, samples) for stream in streams])
    zeros = np.zeros(command.shape)
    silence = _Disturbance(zeros, zeros)
    response = _run_stable_loop(loop, settings, command, silence, silence)
    voluntary = noise = silence
    if settings.voluntary > 0 or settings.snr_db is not None:
        deviation = np.std((response[1] + response[2])[:, settling:], axis=1)[:, None]
        if settings.voluntary > 0:
            voluntary = _draw_voluntary(settings, streams, samples, settings.voluntary * deviation)
        if settings.snr_db is not None:
            ratio = 10 ** (-settings.snr_db / 20)
            noise = _draw_measurement_noise(settings, streams, samples, ratio * deviation)
        response = _run_stable_loop(loop, settings, command, noise, voluntary)
    reference = antialias(command, settings, "zoh")
    for k, seed in enumerate(seeds):
        signals = *response[:, k], voluntary.record[k], noise.record[k], reference[k]
        yield _make_trial(settings, seed, *(signal[settling:] for signal in signals))


def _make_trial(
    settings: SimulationSettings,
    seed: int | np.random.SeedSequence,
    position: np.ndarray,
    intrinsic: np.ndarray,
    reflex: np.ndarray,
    voluntary: np.ndarray,
    noise: np.ndarray,
    reference: np.ndarray,
) -> xr.Dataset:
    """Trial of recorded signals, with its seed and settings as attributes."""
    attributes = {name: int(value) if isinstance(value, bool) else value for name, value in settings}
    return new_trial(
        position,
        intrinsic + reflex + voluntary + noise,
        settings.recording_rate,
        reference,
        torque_intrinsic=intrinsic,
        torque_reflex=reflex,
        torque_voluntary=voluntary,
        torque_noise=noise,
        # As text where the entropy is too long for an integer of a file.
        seed=seed if isinstance(seed, int) and abs(seed) < 2**63 else str(_seed_sequence(seed)),
        **attributes,
    )


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
    keys = [(*root.spawn_key, k) for k in range(3)]
    return _Streams(*(np.random.default_rng(np.random.SeedSequence(root.entropy, spawn_key=key)) for key in keys))


def _draw_command(settings: SimulationSettings, rng: np.random.Generator, samples: int) -> np.ndarray:
    """Position command [rad], shape (samples,)."""
    interval = round(settings.switching_interval * settings.recording_rate)
    if settings.perturbation == "prbs":
        return draw_prbs(rng, samples, interval, settings.amplitude)
    length = round(settings.pulse_length * settings.recording_rate)
    return draw_pulses(rng, samples, interval, length, settings.amplitude)


def _draw_voluntary(
    settings: SimulationSettings, streams: Sequence[_Streams], samples: int, deviation: np.ndarray
) -> _Disturbance:
    """Voluntary torque of a standard deviation [N·m], shape (trials, 1)."""
    rate, cutoff = settings.recording_rate, settings.voluntary_cutoff
    signals = [draw_voluntary_torque(stream.voluntary, samples, rate, cutoff) for stream in streams]
    torque = deviation * np.stack(signals)
    return _Disturbance(torque, antialias(torque, settings, "foh"))


def _draw_measurement_noise(
    settings: SimulationSettings, streams: Sequence[_Streams], samples: int, deviation: np.ndarray
) -> _Disturbance:
    """Measurement noise that has a standard deviation [N·m], shape (trials, 1), behind the anti-aliasing filter."""
    hold = round(settings.recording_rate / settings.noise_rate)
    level = deviation / _recorded_noise_deviation(settings, hold)
    torque = level * np.stack([draw_noise(stream.noise, samples, hold) for stream in streams])
    return _Disturbance(torque, antialias(torque, settings, "zoh"))


@lru_cache
def _recorded_noise_deviation(settings: SimulationSettings, hold: int) -> float:
    """Standard deviation, behind the anti-aliasing filter, of unit white noise that is held for some samples."""
    pulse = np.zeros(HELD_VALUES * hold)
    pulse[:hold] = 1.0
    return float(np.sqrt(np.sum(antialias(pulse, settings, "zoh") ** 2) / hold))


def _run_stable_loop(
    loop: Loop, settings: SimulationSettings, command: np.ndarray, noise: _Disturbance, voluntary: _Disturbance
) -> np.ndarray:
    """Recorded position, intrinsic and reflex torque, shape (3, trials, samples); a loop that diverges is an error."""
    record, divergence = run_loop(loop, settings, command, noise.torque, voluntary.torque)
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
