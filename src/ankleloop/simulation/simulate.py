"""A simulated experiment: from settings and a seed to a trial with its true torques."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import as_plain, as_real, check_memory, show_fields, show_value
from ankleloop.simulation.filters import antialias, draw_slow_noise
from ankleloop.simulation.loop import run_loop
from ankleloop.simulation.settings import DWELL_TIMES, SimulationSettings
from ankleloop.simulation.trajectories import Course, draw_course, trajectories
from ankleloop.trials.trial import new_trial

HELD_NOISE_VALUES = 100  # over which the anti-aliasing filter settles
RATE_TOLERANCE = 1e-4  # of the rate of a command
TRIAL_ARRAYS = 16  # arrays over all samples of a trial that are in memory at a time, at least


@show_fields(SimulationSettings)
def simulate(
    *,
    seed: int | np.random.SeedSequence,
    load: Sequence[float] | None = None,
    command: ArrayLike | None = None,
    **settings: Any,
) -> xr.Dataset:
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
    command : array_like, shape (duration × recording_rate,), optional
        A perturbation of one's own [rad] instead of one that is drawn, at the recording rate; without a duration, that
        of the command. Its end also precedes the record: it is repeated while the loop settles.
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
    DataError
        For a command of another length or rate than the record, or that is no finite numbers.

    See Also
    --------
    ankleloop.new_trial : A trial from arrays.
    ankleloop.read_trial : A trial from a file.

    Examples
    --------
    >>> trial = simulate(seed=1, duration=10.0)
    >>> trial.sizes["time"]
    10000
    """
    values = SimulationSettings.parse("simulate", load=load, **settings)
    own_command = None
    if command is not None:
        own_command = _check_command(command, values.recording_rate)
        if "duration" not in settings:
            duration = own_command.size / values.recording_rate
            values = SimulationSettings.parse("simulate", **{**dict(values), "duration": duration})
    samples = (values.duration + values.settling) * values.recording_rate
    check_memory(
        "simulate",
        8.0 * TRIAL_ARRAYS * samples,
        "take a shorter duration or settling, or a lower recording_rate",
    )
    trial = _simulate(values, _check_seed(seed), own_command)
    return trial if own_command is None else trial.assign_attrs(perturbation="command")


def _check_command(command: ArrayLike, rate: float) -> np.ndarray:
    """A command [rad], whose times, where it has them, must be those of samples of the record."""
    if isinstance(command, xr.DataArray) and "time" in command.coords and command.size > 1:
        times = as_real(command["time"], "time of the command")
        own_rate = (times.size - 1) / np.ptp(times)
        if not abs(own_rate - rate) <= RATE_TOLERANCE * rate:
            raise DataError(
                f"simulate: command has {own_rate:.6g} samples a second, but recording_rate is {rate:g} Hz: "
                f"draw it at this rate, or set recording_rate={own_rate:.6g}."
            )
    return as_real(command, "command")


def _repeat_command(command: np.ndarray, settings: SimulationSettings) -> np.ndarray:
    """A command over the record, with its end ahead of it [rad]."""
    rate = settings.recording_rate
    samples = round(settings.duration * rate)
    if command.shape != (samples,) or not np.isfinite(command).all():
        raise DataError(
            f"simulate: command must be {samples} finite numbers [rad] for a duration of {settings.duration:g} s, got "
            f"shape {command.shape}: leave out the duration, or draw a command of this duration."
        )
    return command.take(np.arange(-round(settings.settling * rate), samples), mode="wrap")


def _simulate(
    settings: SimulationSettings,
    seed: int | np.random.SeedSequence,
    own_command: np.ndarray | None = None,
) -> xr.Dataset:
    rate = settings.recording_rate
    settling = round(settings.settling * rate)
    time = np.arange(-settling, round(settings.duration * rate)) / rate
    root = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
    # Keys of the streams are set here: `SeedSequence.spawn` counts its calls, so the same seed would give other bits.
    seeds = [np.random.SeedSequence(root.entropy, spawn_key=(*root.spawn_key, k)) for k in range(4)]
    for_perturbation, for_voluntary, for_noise, for_course = map(np.random.default_rng, seeds)
    course = draw_course(settings, for_course)
    joint = trajectories(course, time + 0.5 / rate)
    if own_command is None:
        command = _draw_command(settings, for_perturbation, course, time)
    else:
        command = _repeat_command(own_command, settings)
    silence = np.zeros(time.size)
    response = run_loop(settings, joint, command, silence, silence)
    clean_torque = (response[1] + response[2])[settling:]
    level = settings.torque_level or float(np.std(clean_torque))
    voluntary = level * _draw_voluntary(settings, for_voluntary, course, time)
    noise = silence
    if settings.snr_db is not None:
        deviation = 10 ** (-settings.snr_db / 20) * level
        noise = deviation * _draw_noise(settings, for_noise, time.size)
    if settings.movement > 0:
        command = command + course.movement(time)
    if voluntary.any() or noise.any() or settings.movement > 0:
        response = run_loop(settings, joint, command, noise, voluntary)
    position, intrinsic, reflex = response[:, settling:]
    reference = antialias(command, settings, "zoh")[settling:]
    recorded_noise = antialias(noise, settings, "zoh")[settling:]
    recorded_voluntary = antialias(voluntary, settings, "foh")[settling:]
    return new_trial(
        position,
        intrinsic + reflex + recorded_voluntary + recorded_noise,
        rate,
        reference,
        torque_intrinsic=intrinsic,
        torque_reflex=reflex,
        torque_voluntary=recorded_voluntary,
        torque_noise=recorded_noise,
        **_describe_course(course, time[settling:]),
        # As text where the entropy is too long for an integer of a file.
        seed=seed if isinstance(seed, int) and seed < 2**63 else str(root),
        **{name: _as_attribute(value) for name, value in settings},
    )


def _describe_course(course: Course, time: np.ndarray) -> dict[str, np.ndarray]:
    """Variables of a trial whose parameters vary, or that moves: phase or scheduling variable, and true K, B and G."""
    settings = course.settings
    variables = {}
    if settings.variation == "schedule":
        variables["schedule"] = course.schedule(time)
    elif (
        settings.variation == "cycle"
        or settings.perturbation_locked
        or settings.locked_torque
        or settings.movement
    ):
        variables["phase"] = course.phase(time)
    if settings.variation is not None:
        names = ("stiffness_true", "viscosity_true", "reflex_gain_true")
        variables |= dict(zip(names, trajectories(course, time), strict=True))
    return variables


def _as_attribute(value: Any) -> Any:
    """A setting as a trial can hold it: tables as text."""
    return ", ".join(map(repr, value)) if isinstance(value, tuple) else value


def _check_seed(seed: Any) -> int | np.random.SeedSequence:
    """Refuse what is no seed; None would not be reproducible."""
    plain = as_plain(seed)
    if isinstance(plain, np.random.SeedSequence) or (type(plain) is int and plain >= 0):
        return plain
    raise ValueError(
        f"simulate: seed must be a whole number of at least 0 or a numpy.random.SeedSequence, got {show_value(seed)}."
    )


def draw_perturbation(
    settings: SimulationSettings, rng: np.random.Generator, samples: int
) -> np.ndarray:
    """Draw a pseudorandom binary sequence, steps after random times, or short pulses of independent random sign [rad].

    A pulse ends before its reflex begins, and its sign is independent of the next one. So the position and its
    derivatives are uncorrelated with the reflex torque, except for the smearing by the actuator.

    Shapes: returns (samples,).
    """
    if settings.perturbation == "dwells":
        return settings.amplitude * _draw_dwells(settings, rng, samples)
    interval = round(settings.switching_interval * settings.recording_rate)
    count = -(-samples // interval)
    if settings.perturbation == "prbs":
        levels = rng.integers(0, 2, size=count) - 0.5
        length = interval
    else:
        levels = rng.choice([-0.5, 0.0, 0.0, 0.5], size=count)
        length = round(settings.pulse_length * settings.recording_rate)
    pulses = np.outer(levels, np.arange(interval) < length)
    return settings.amplitude * pulses.ravel()[:samples]


def _draw_dwells(
    settings: SimulationSettings, rng: np.random.Generator, samples: int
) -> np.ndarray:
    """±½ in turn, each for a dwell time that is drawn by its weight."""
    times = np.array(DWELL_TIMES)
    lengths = np.maximum(1, np.round(times * settings.recording_rate).astype(int))
    weights = np.array(settings.dwell_weights or np.ones(times.size))
    first = rng.choice([-0.5, 0.5])
    count = -(-samples // lengths[0])
    dwells = rng.choice(lengths, size=count, p=weights / weights.sum())
    levels = np.resize([first, -first], count)
    return np.repeat(levels, dwells)[:samples]


def _draw_command(
    settings: SimulationSettings, rng: np.random.Generator, course: Course, time: np.ndarray
) -> np.ndarray:
    """Draw the perturbation [rad] over some times; where it is locked, each cycle begins with its first samples."""
    perturbation = draw_perturbation(settings, rng, time.size)
    if not settings.perturbation_locked:
        return perturbation
    since_onset = time - course.onsets[course.cycle(time)]
    samples = np.round(since_onset * settings.recording_rate).astype(int)
    # A cycle that is longer than all of the run lies beyond the drawn samples while the loop settles only.
    return perturbation.take(samples, mode="wrap")


def _draw_voluntary(
    settings: SimulationSettings, rng: np.random.Generator, course: Course, time: np.ndarray
) -> np.ndarray:
    """Voluntary torque, at random and in step with the cycle, over the deviation of the clean net torque."""
    torque = np.zeros(time.size)
    if settings.locked_torque > 0:
        torque += settings.locked_torque * course.locked_torque(time)
    if settings.voluntary > 0:
        torque += settings.voluntary * draw_slow_noise(
            rng, time.size, settings.recording_rate, settings.voluntary_cutoff
        )
    return torque


def _draw_noise(settings: SimulationSettings, rng: np.random.Generator, samples: int) -> np.ndarray:
    """White noise whose values are held, of unit standard deviation behind the anti-aliasing filter."""
    hold = round(settings.recording_rate / settings.noise_rate)
    levels = rng.standard_normal(-(-samples // hold))
    noise = np.repeat(levels, hold)[:samples]
    pulse = np.zeros(HELD_NOISE_VALUES * hold)
    pulse[:hold] = 1.0
    response = antialias(pulse, settings, "zoh")
    return noise / np.sqrt(np.sum(response**2) / hold)
