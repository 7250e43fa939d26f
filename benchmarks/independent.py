"""Records of a joint in a loop that owe nothing to `ankleloop.simulate`: Runge-Kutta of fourth order, delayed states.

Units are rad, N·m and s; torque opposes stretch. The joint, its load and the actuator are one system of equations,
with what a real joint may have beside K, B, I and a reflex of velocity.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy import signal

from ankleloop import new_trial

FAST = 10_000  # Hz, of the integration
SETTLING = 50_000  # samples ahead of the record, which are dropped
DELAY = 400  # samples, of the reflex
HOLD = 100  # samples over which a value of the noise is held
# Levels, their lengths in samples and the cutoff of a low-pass [Hz]; beside them there is "multisine".
KINDS = {
    "prbs": ((-1, 1), (1000,), 1000.0),
    "slow": ((-1, 1), (1000,), 5.0),
    "3 levels": ((-1, 0, 1), (1000,), 1000.0),
    "steps": (np.linspace(-1, 1, 21), range(1000, 5000), 1000.0),
    "dwells": ((-1, 1), (200, 400, 800, 1500, 3000, 6000), 1000.0),
    "gaussian": ((-1, 1), (10,), 10.0),  # the sum of many
}
# Places in the state; behind each of the first three stands its rate.
SERVO = 0
JOINT = 2
MUSCLE = 4  # torque of reflex and reaction
CREEP = 6
BRISTLE = 7
STATES = 8


class Plant(NamedTuple):
    """Joint and load."""

    stiffness: float = 150.0
    viscosity: float = 0.8
    inertia: float = 0.015
    gain: float = 13.0
    antagonist: float = 0.0  # reflex gain in the other direction
    threshold: float = 0.0  # of the reflex [rad/s]
    middle: float = 0.0  # whether there is a reflex in the middle third of the record alone
    delay_drift: float = 0.0  # of the delay of the reflex over the record, about its mean [ms]
    delay_jitter: float = 0.0  # of that delay from second to second, at most [ms]
    reaction: float = 0.0  # to the position, against it [N·m/rad]
    latency: int = 1650  # samples, of the reaction
    cubic: float = 0.0  # N·m/rad³
    drag: float = 0.0  # N·m·s²/rad²
    relaxing: float = 0.0  # stiffness that relaxes, in 0.5 s [N·m/rad]
    short_range: float = 0.0  # stiffness that yields, after 5 mrad [N·m/rad]
    fatigue: float = 0.0  # fall over the record, of the mean of K; twice as much of that of G
    load: tuple = (1.1, 7.1, 250.0)  # its inertia, viscosity and stiffness


@njit(cache=True)
def _follow(state, place, omega, damping, target, rates):
    """Rates of a second-order system that follows a target."""
    speed = state[place + 1]
    rates[place] = speed
    rates[place + 1] = omega * (omega * (target - state[place]) - 2.0 * damping * speed)


@njit(cache=True)
def _move(state, plant, stiffness, command, drive, external, rates):
    """Rates of the state; command, drive of the muscle and external torque are held over a step."""
    position = state[JOINT]
    velocity = state[JOINT + 1]
    speed = abs(velocity)
    _follow(state, SERVO, 125.66, 0.8, command, rates)
    _follow(state, MUSCLE, 40.0, 1.0, drive, rates)
    rates[CREEP] = (position - state[CREEP]) / 0.5
    rates[BRISTLE] = velocity - speed * state[BRISTLE] / 0.005
    torque = stiffness * position + plant.cubic * position**3 + state[MUSCLE] + external
    torque += (plant.viscosity + plant.drag * speed) * velocity
    torque += plant.relaxing * (position - state[CREEP]) + plant.short_range * state[BRISTLE]
    load_inertia, load_viscosity, load_stiffness = plant.load
    push = load_inertia * rates[SERVO + 1] + load_viscosity * (state[SERVO + 1] - velocity)
    push += load_stiffness * (state[SERVO] - position)
    rates[JOINT] = velocity
    rates[JOINT + 1] = (push - torque) / (load_inertia + plant.inertia)


@njit(cache=True)
def _draw_sign(number):
    """A number from -1 to 1 that looks drawn, the same for each number."""
    return 2.0 * ((43758.5453 * np.sin(12.9898 * number)) % 1.0) - 1.0


@njit(cache=True)
def _integrate(plant, command, external):
    """States over time, from rest.

    Shapes: command and external torque (N,), held over a step; returns (N, STATES).
    """
    states = np.zeros((command.size, STATES))
    rates = np.zeros((4, STATES))
    for n in range(command.size - 1):
        fatigue = plant.fatigue * (max(n - SETTLING, 0) / (command.size - SETTLING) - 0.5)
        stiffness = plant.stiffness * (1.0 - fatigue)
        share = max(n - SETTLING, 0) / (command.size - SETTLING)
        late = plant.delay_drift * (share - 0.5) + plant.delay_jitter * _draw_sign(n // FAST)
        velocity = states[max(n - DELAY - round(late * FAST / 1000), 0), JOINT + 1]
        gain = plant.gain * (1.0 - 2.0 * fatigue)
        if plant.middle and abs(share - 0.5) > 1.0 / 6.0:
            gain = 0.0
        drive = gain * max(velocity - plant.threshold, 0.0)
        drive += plant.antagonist * min(velocity, 0.0)
        drive += plant.reaction * states[max(n - plant.latency, 0), JOINT]
        for stage, share in enumerate((0.0, 0.5, 0.5, 1.0)):
            point = states[n] + share / FAST * rates[stage - 1]
            _move(point, plant, stiffness, command[n], drive, external[n], rates[stage])
        mean = (rates[0] + 2.0 * rates[1] + 2.0 * rates[2] + rates[3]) / 6.0
        states[n + 1] = states[n] + mean / FAST
    return states


def _run(plant, command, external):
    """Position, and the net torque, which is what the load gives way to."""
    states = _integrate(plant, command, external)
    give, velocity = (states[:, SERVO:JOINT] - states[:, JOINT:MUSCLE]).T
    acceleration = np.gradient(velocity, 1.0 / FAST)
    inertia, viscosity, stiffness = plant.load
    return states[:, JOINT], inertia * acceleration + viscosity * velocity + stiffness * give


def _pass_low(x, cutoff, order=4):
    """Bessel low-pass."""
    return signal.sosfilt(signal.bessel(order, cutoff, fs=FAST, norm="mag", output="sos"), x)


def _draw_command(kind, rng, samples):
    """Command with a standard deviation of 0.02 rad."""
    if kind == "multisine":  # 0.1 to 10 Hz, of one amplitude
        lines = np.exp(2j * np.pi * rng.random(101))
        command = np.resize(np.fft.irfft(lines, 10 * FAST), samples)
    else:
        levels, lengths, cutoff = KINDS[kind]
        count = samples // min(lengths) + 1
        steps = np.repeat(rng.choice(levels, count), rng.choice(lengths, count))
        command = _pass_low(steps[:samples], cutoff)
    return 0.02 * command / command.std()


def simulate_independently(
    seed,
    *,
    kind="prbs",
    duration=50.0,
    rate=1000,
    voluntary=0.05,
    snr_db=10.0,
    cutoff=200.0,
    order=4,
    **plant,
):
    """A trial with a command of one of `KINDS` and properties of a `Plant`, at a rate [Hz] that divides 10 kHz.

    Voluntary torque and noise (none for infinity) are over the standard deviation of the torque without both. Cutoff
    [Hz] and order are those of the filter before samples are taken; there is none for order 0.
    """
    plant = Plant(**plant)
    rng = np.random.default_rng(seed)
    samples = SETTLING + round(duration * FAST)

    def record(channel):
        filtered = _pass_low(channel, min(cutoff, 0.2 * rate), order) if order else channel
        return filtered[SETTLING :: FAST // rate]

    command = _draw_command(kind, rng, samples)
    slow = _pass_low(rng.standard_normal(samples), 2.0, order=2)
    noise = np.repeat(rng.standard_normal(samples // HOLD), HOLD)
    external = np.zeros(samples)
    level = record(_run(plant, command, external)[1]).std()
    for share, torque in ((voluntary, slow), (10 ** (-snr_db / 20), noise)):
        external += share * level / record(torque).std() * torque
    position, torque = _run(plant, command, external)
    return new_trial(record(position), record(torque), rate, record(command))
