"""Ensembles of perturbed and nominal trials of a joint with a known reflex: a simulator of their own.

It shares nothing with `ankleloop.simulate`: Runge-Kutta steps of 0.2 ms of joint, load and servo, all trials side by
side, and analog anti-aliasing filters before the recorder.
"""

from dataclasses import dataclass, field, replace

import numba
import numpy as np
from scipy import signal

from ankleloop import new_trial

TRUTH = {"K": 150.0, "B": 0.8, "I": 0.015, "G": 10.0, "delay": 0.04, "omega_n": 40.0, "zeta": 1.0}
LIGHT = (0.1, 10.0, 100.0)  # inertia, viscosity and stiffness of the load
STIFF = (0.1, 200.0, 20_000.0)
STEP = 2e-4  # s
STEPS = 5  # in a recorded sample
BEFORE, AFTER = 0.3, 0.45  # s of the windows about the onset
SETTLING = 1.2  # s before the onset in which the joint comes to its movement
AMPLITUDE = 0.05  # rad, of a ramp
RISE = 0.06  # s
STATES = 7  # servo, load and reflex with their rates; short-range element


@dataclass(frozen=True)
class Ensemble:
    """How an ensemble is simulated."""

    load: tuple = LIGHT
    voluntary: float = 0.5  # N·m, standard deviation
    trials: dict = field(default_factory=lambda: {"nominal": 100, "up": 40})
    command: str = "ramp"  # "pulse", "sequences" or "own sequences"
    moving: bool = False  # 0.1 rad and 10 N·m at 0.8 Hz
    any_phase: bool = False  # of the movement at the onset
    stiffness_scatter: float = 0.0  # relative, between trials
    stiffness_slope: float = 0.0  # relative, in a second from the onset on
    gain: float = TRUTH["G"]
    threshold: float = 0.0  # of the reflex [rad/s]
    reaction: float = 0.0  # N·m from 130 ms on, in perturbed trials
    short_range: float = 0.0  # N·m/rad, in 5 mrad
    difference: float = 0.0  # N·m, of perturbed trials, from the start
    jitter: float = 0.0  # s, error of the onsets
    offset: float = 1.0  # N·m, between trials
    torque_noise: float = 0.5  # N·m, white at 1 kHz; it is fed back
    position_noise: float = 1e-4  # rad
    after: float = AFTER


@numba.njit(cache=True)
def slopes(x, command, torque, velocity, stiffness, gain, threshold, short_range, load, out):
    """Time derivatives of the states, and the torque of the joint."""
    frequency, damping = 2 * np.pi * 20.0, 0.8
    servo = frequency**2 * (command - x[0]) - 2 * damping * frequency * x[1]
    position = x[0] - x[2]
    rate = x[1] - x[3]
    passive = stiffness * position + 0.8 * rate + short_range * x[6] + x[4] + torque
    # The inertia of the joint moves with that of the load.
    acceleration = (passive + 0.015 * servo - load[1] * x[3] - load[2] * x[2]) / (load[0] + 0.015)
    drive = gain * max(0.0, velocity - threshold)
    stretch = rate
    if (x[6] > 0.005 and rate > 0.0) or (x[6] < -0.005 and rate < 0.0):
        stretch = 0.0
    out[0], out[1], out[2], out[3] = x[1], servo, x[3], acceleration
    out[4], out[5], out[6] = x[5], 1600.0 * (drive - x[4]) - 80.0 * x[5], stretch
    return passive + 0.015 * (servo - acceleration)


@numba.njit(cache=True)
def integrate(command, torque, stiffness, gain, threshold, short_range, load, start, late):
    """Position and torque of every trial by Runge-Kutta steps; inputs of shape (trials, steps)."""
    trials, steps = command.shape
    position = np.empty((trials, steps))
    total = np.empty((trials, steps))
    k1, k2, k3, k4 = np.empty(7), np.empty(7), np.empty(7), np.empty(7)
    for i in range(trials):
        x = start[i].copy()
        rates = np.zeros(steps)
        for t in range(steps):
            rates[t] = x[1] - x[3]
            before = rates[t - late] if t >= late else 0.0
            after = rates[t + 1 - late] if t + 1 >= late else 0.0
            middle = 0.5 * (before + after)
            u = command[i, t]
            v = command[i, min(t + 1, steps - 1)]
            n = torque[i, t]
            k = stiffness[i, t]
            more = (k, gain, threshold, short_range, load)
            position[i, t] = x[0] - x[2]
            total[i, t] = slopes(x, u, n, before, *more, k1)
            slopes(x + 0.5 * STEP * k1, 0.5 * (u + v), n, middle, *more, k2)
            slopes(x + 0.5 * STEP * k2, 0.5 * (u + v), n, middle, *more, k3)
            slopes(x + STEP * k3, v, n, after, *more, k4)
            x = x + STEP / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return position, total


def make_command(kind, name, time, generator):
    """Command of a trial over the time from its onset [rad]."""
    if name == "nominal":
        return np.zeros(time.size)
    if kind.endswith("sequences"):  # 0.04 rad peak to peak, 100 ms
        own = generator if kind.startswith("own") else np.random.default_rng(int(name))
        levels = own.choice([-0.02, 0.02], 20)
        places = np.clip(np.floor(time / 0.1).astype(int), 0, 19)
        return np.where(time >= 0.0, levels[places], 0.0)
    ramp = np.clip(time / RISE, 0.0, 1.0)
    if kind == "pulse":
        ramp -= np.clip((time - 0.15) / RISE, 0.0, 1.0)
    return (-1.0 if name == "down" else 1.0) * AMPLITUDE * ramp


def voluntary_torque(shape, generator):
    """Noise of unit variance through a Butterworth low-pass of second order at 2 Hz, at 1 kHz."""
    burn = 2000
    sections = signal.butter(2, 2.0, fs=1000.0, output="sos")
    noise = generator.standard_normal((shape[0], shape[1] + burn))
    impulse = signal.sosfilt(sections, np.eye(1, 20_000)[0])
    return signal.sosfilt(sections, noise, axis=1)[:, burn:] / np.linalg.norm(impulse)


def record(position, torque, settings, generator):
    """What a recorder of 1 kHz with filters of 200 Hz and noise makes of position and torque."""
    sections = signal.bessel(4, 200.0, fs=1.0 / STEP, output="sos", norm="mag")
    state = signal.sosfilt_zi(sections)[:, None]
    channels = []
    for channel in (position, torque):
        filtered, _ = signal.sosfilt(sections, channel, axis=1, zi=state * channel[:, :1])
        channels.append(filtered[:, ::STEPS])
    noise = settings.position_noise * generator.standard_normal(channels[0].shape)
    return channels[0] + noise, channels[1]


def simulate_trials(settings, commands, time, groups, generator):
    """Recorded position and torque of trials whose commands are given over time, shapes (trials, samples)."""
    trials, samples = commands.shape
    held = np.repeat(
        settings.voluntary * voluntary_torque(commands[:, ::STEPS].shape, generator)
        + settings.torque_noise * generator.standard_normal(commands[:, ::STEPS].shape)
        + settings.offset * generator.standard_normal((trials, 1)),
        STEPS,
        axis=1,
    )[:, :samples]
    perturbed = (groups != "nominal")[:, None]
    held = held + settings.difference * perturbed
    held = held + settings.reaction * perturbed * np.clip((time - 0.13) / 0.05, 0.0, 1.0)
    if settings.moving:
        phase = generator.uniform(0, 2 * np.pi, (trials, 1)) if settings.any_phase else 0.7
        angle = 2 * np.pi * 0.8 * time + phase
        commands = commands + 0.1 * np.sin(angle)
        held = held + 10.0 * np.sin(angle + 0.5)
    scale = 1.0 + settings.stiffness_scatter * generator.standard_normal((trials, 1))
    stiffness = TRUTH["K"] * scale * (1.0 + settings.stiffness_slope * np.maximum(time, 0.0))
    late = round(TRUTH["delay"] / STEP)
    position, torque = integrate(
        commands,
        held,
        np.broadcast_to(stiffness, commands.shape).copy(),
        settings.gain,
        settings.threshold,
        settings.short_range,
        settings.load,
        np.zeros((trials, STATES)),
        late,
    )
    return record(position, torque, settings, generator)


def simulate_ensemble(settings, seed):
    """Windows of an ensemble, as a list of trials with the attributes `condition` and `onset`."""
    generator = np.random.default_rng(seed)
    names = np.repeat(list(settings.trials), list(settings.trials.values()))
    groups = generator.permutation(names)
    count = round((SETTLING + settings.after) / STEP)
    time = (np.arange(count) - round(SETTLING / STEP)) * STEP
    late = settings.jitter * generator.standard_normal(groups.size)
    commands = np.array(
        [
            make_command(settings.command, name, time - shift, generator)
            for name, shift in zip(groups, late, strict=True)
        ]
    )
    position, torque = simulate_trials(settings, commands, time, groups, generator)
    first = round((SETTLING - BEFORE) / STEP / STEPS)
    return [
        new_trial(angle[first:], moment[first:], 1000.0, condition=name, onset=BEFORE)
        for angle, moment, name in zip(position, torque, map(str, groups), strict=True)
    ]


def simulate_record(settings, seed, duration=300.0):
    """A record with a ramp every 3 to 6 s, that goes back after 1 s: trial, onsets and conditions."""
    generator = np.random.default_rng(seed)
    time = np.arange(round(duration / STEP)) * STEP
    onsets = np.cumsum(generator.uniform(1.5, 3.0, round(duration / 2.3)))
    onsets = np.round(onsets[onsets < duration - 2.0], 3)
    kinds = generator.permutation(np.arange(onsets.size) % 2)
    command = np.zeros(time.size)
    for onset in onsets[kinds == 1]:
        ramp = np.clip((time - onset) / RISE, 0.0, 1.0)
        command += AMPLITUDE * (ramp - np.clip((time - onset - 1.0) / RISE, 0.0, 1.0))
    groups = np.array(["record"])
    quiet = replace(settings, reaction=0.0, difference=0.0, stiffness_slope=0.0, offset=0.0)
    position, torque = simulate_trials(quiet, command[None], time, groups, generator)
    trial = new_trial(position[0], torque[0], 1000.0, reference=command[::STEPS])
    return trial, onsets, np.where(kinds == 1, "up", "nominal").tolist()
