"""Records of a joint in a loop that owe nothing to `ankleloop.simulate`: Runge-Kutta of fourth order, delayed states.

Units are rad, N·m and s; torque opposes stretch. The joint, its load and the actuator are one system of equations,
with what a real joint may have beside K, B, I and a reflex of velocity.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy import signal

from ankleloop import new_trial

SETTLING = 5.0  # s ahead of the record, which are dropped
FAST = 10_000  # Hz, of the integration
NOISE_RATE = 100  # Hz, at which the values of the noise are held
BROAD = 1000.0  # Hz
# Levels, their durations [s] and the cutoff of a low-pass [Hz]; beside them there is "multisine".
KINDS = {
    "prbs": ((-1.0, 1.0), (0.1,), BROAD),
    "slow": ((-1.0, 1.0), (0.1,), 5.0),
    "3 levels": ((-1.0, 0.0, 1.0), (0.1,), BROAD),
    "steps": (np.linspace(-1.0, 1.0, 21), np.linspace(0.1, 0.5, 21), BROAD),
    "dwells": ((-1.0, 1.0), (0.02, 0.04, 0.08, 0.15, 0.3, 0.6), BROAD),
    "gaussian": ((-1.0, 1.0), (0.001,), 10.0),  # the sum of many
}
# Places in the state; behind each of the first three stands its rate.
SERVO = 0
GIVE = 2  # of the load
MUSCLE = 4  # torque of reflex and reaction
CREEP = 6
BRISTLE = 7
STATES = 8


class Plant(NamedTuple):
    """Joint, load and actuator."""

    stiffness: float = 150.0
    viscosity: float = 0.8
    inertia: float = 0.015
    gain: float = 13.0
    delay: float = 0.04
    omega: float = 40.0  # of the muscle, critically damped
    antagonist: float = 0.0  # reflex gain in the other direction
    reaction: float = 0.0  # to the position, against it [N·m/rad]
    latency: float = 0.165  # of the reaction
    cubic: float = 0.0  # N·m/rad³
    drag: float = 0.0  # N·m·s²/rad²
    relaxing: float = 0.0  # stiffness that relaxes [N·m/rad]
    relaxation: float = 0.5  # time constant
    short_range: float = 0.0  # stiffness that yields [N·m/rad]
    yielding: float = 0.005  # rad
    stiffness_change: float = 0.0  # over the record, of what it is at its start
    gain_change: float = 0.0
    load_inertia: float = 1.1
    load_viscosity: float = 7.1
    load_stiffness: float = 250.0
    servo: float = 125.66  # rad/s
    damping: float = 0.8  # of the servo


@njit(cache=True)
def _move(state, plant, stiffness, command, drive, external, rates):
    """Rates of the state; command, drive of the muscle and external torque are held over a step."""
    position = state[SERVO] - state[GIVE]
    velocity = state[SERVO + 1] - state[GIVE + 1]
    speed = abs(velocity)
    pull = plant.servo * (command - state[SERVO]) - 2.0 * plant.damping * state[SERVO + 1]
    rates[SERVO] = state[SERVO + 1]
    rates[SERVO + 1] = plant.servo * pull
    rates[MUSCLE] = state[MUSCLE + 1]
    rates[MUSCLE + 1] = plant.omega * (
        plant.omega * (drive - state[MUSCLE]) - 2.0 * state[MUSCLE + 1]
    )
    rates[CREEP] = (position - state[CREEP]) / plant.relaxation
    rates[BRISTLE] = velocity - speed * state[BRISTLE] / plant.yielding
    force = stiffness * position + plant.cubic * position**3
    force += (plant.viscosity + plant.drag * speed) * velocity
    force += plant.relaxing * (position - state[CREEP]) + plant.short_range * state[BRISTLE]
    force += plant.inertia * rates[SERVO + 1] + state[MUSCLE] + external
    force -= plant.load_viscosity * state[GIVE + 1] + plant.load_stiffness * state[GIVE]
    rates[GIVE] = state[GIVE + 1]
    rates[GIVE + 1] = force / (plant.load_inertia + plant.inertia)


@njit(cache=True)
def _integrate(plant, command, external, progress):
    """States at the ends of the steps, from rest.

    Shapes: command, external torque and progress through the record (N,); returns (N + 1, STATES).
    """
    states = np.zeros((command.size + 1, STATES))
    rates = np.zeros((4, STATES))
    point = np.zeros(STATES)
    delay = round(plant.delay * FAST)
    latency = round(plant.latency * FAST)
    for n in range(command.size):
        stiffness = plant.stiffness * (1.0 + plant.stiffness_change * progress[n])
        gain = plant.gain * (1.0 + plant.gain_change * progress[n])
        earlier = states[max(n - delay, 0)]
        velocity = earlier[SERVO + 1] - earlier[GIVE + 1]
        drive = gain * max(velocity, 0.0) + plant.antagonist * min(velocity, 0.0)
        earlier = states[max(n - latency, 0)]
        drive += plant.reaction * (earlier[SERVO] - earlier[GIVE])
        for stage, share in enumerate((0.0, 0.5, 0.5, 1.0)):
            for i in range(STATES):
                point[i] = states[n, i] + share / FAST * rates[stage - 1, i]
            _move(point, plant, stiffness, command[n], drive, external[n], rates[stage])
        for i in range(STATES):
            mean = (rates[0, i] + 2.0 * (rates[1, i] + rates[2, i]) + rates[3, i]) / 6.0
            states[n + 1, i] = states[n, i] + mean / FAST
    return states


def _run(plant, command, external, progress):
    """Means of position and net torque over each step; the torque is what moves the load."""
    states = _integrate(plant, command, external, progress)
    mean = 0.5 * (states[:-1] + states[1:])
    torque = plant.load_inertia * FAST * np.diff(states[:, GIVE + 1])
    torque += plant.load_viscosity * mean[:, GIVE + 1] + plant.load_stiffness * mean[:, GIVE]
    return mean[:, SERVO] - mean[:, GIVE], torque


def _pass_low(x, cutoff, order=4):
    """Bessel low-pass."""
    return signal.sosfilt(signal.bessel(order, cutoff, fs=FAST, norm="mag", output="sos"), x)


def _draw_command(kind, rng, samples):
    """Command with a standard deviation of 0.02 rad."""
    if kind == "multisine":  # 0.1 to 10 Hz, of one amplitude
        lines = np.exp(2j * np.pi * rng.random(101))
        command = np.resize(np.fft.irfft(lines, 10 * FAST), samples)
    else:
        levels, durations, cutoff = KINDS[kind]
        count = int(samples / FAST / min(durations)) + 1
        lengths = np.round(FAST * rng.choice(durations, count)).astype(int)
        command = np.repeat(rng.choice(levels, count), lengths)[:samples]
        command = _pass_low(command, cutoff)
    return 0.02 * command / command.std()


def simulate_independently(
    seed, *, kind="prbs", duration=50.0, rate=1000, voluntary=0.05, snr_db=10.0, **plant
):
    """A trial with a command of one of `KINDS` and properties of a `Plant`, at a rate [Hz] that divides 10 kHz.

    Voluntary torque and noise (none for infinity) are over the standard deviation of the torque without both.
    """
    plant = Plant(**plant)
    rng = np.random.default_rng(seed)
    settling = round(SETTLING * FAST)
    samples = settling + round(duration * FAST)
    progress = np.linspace(-SETTLING / duration, 1.0, samples).clip(0.0)

    def record(channel):
        return _pass_low(channel, min(200.0, 0.2 * rate))[settling :: FAST // rate]

    command = _draw_command(kind, rng, samples)
    slow = _pass_low(rng.standard_normal(samples), 2.0, order=2)
    hold = FAST // NOISE_RATE
    noise = np.repeat(rng.standard_normal(samples // hold), hold)
    level = record(_run(plant, command, np.zeros(samples), progress)[1]).std()
    external = voluntary * level / record(slow).std() * slow
    external += 10 ** (-snr_db / 20) * level / record(noise).std() * noise
    position, torque = _run(plant, command, external, progress)
    return new_trial(record(position), record(torque), float(rate), record(command))
