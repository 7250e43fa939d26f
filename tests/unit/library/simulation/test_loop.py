"""The simulated loop against an adaptive solver and against closed forms."""

import numpy as np
import pytest
from scipy import signal as sps
from scipy.integrate import solve_ivp

from ankleloop import UnstableLoopError
from ankleloop.simulation.loop import run_loop
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import draw_course, trajectories

RATE = 1000.0
SEGMENT = 0.01  # s: divides the switching interval, the delay and the hold of the noise


def external_signals(seconds, *, noise=0.0, ramp=0.0):
    rng = np.random.default_rng(5)
    samples = round(seconds * RATE)
    command = 0.04 * (np.repeat(rng.integers(0, 2, samples // 100 + 1), 100)[:samples] - 0.5)
    noise = noise * np.repeat(rng.standard_normal(samples // 10 + 1), 10)[:samples]
    return command, noise, ramp * np.arange(samples) / RATE


def run(settings, *external, course=None):
    """Run the loop with the joint of the settings."""
    course = course or draw_course(settings, np.random.default_rng(0))
    time = (np.arange(external[0].size) + 0.5) / settings.recording_rate - settings.settling
    return run_loop(settings, trajectories(course, time), *external)


def bessel(cutoff):
    # Designed at 1 rad/s and then scaled in time: otherwise its states would be 1e-13 of the output, below the absolute
    # tolerance of the solver.
    A, b, c, d = sps.tf2ss(*sps.bessel(4, 1.0, analog=True, norm="mag"))
    return 2 * np.pi * cutoff * A, 2 * np.pi * cutoff * b, c, d


class AdaptiveSolution:
    """The loop from its equations of motion: servo, load, reflex and three recorder channels, solved in segments."""

    def __init__(self, settings, command, noise, voluntary):
        self.settings = settings
        self.external = command, noise, voluntary
        self.time = np.arange(voluntary.size) / RATE
        self.filter = bessel(settings.antialias_cutoff)
        self.segments = []
        self.order = 2 if settings.pole is None else 3

    def delayed_velocity(self, t):
        time = t - self.settings.delay
        if time <= 0:
            return 0.0
        # A point between two segments belongs to the earlier one: velocity is continuous.
        state = self.segments[min(int(time / SEGMENT), len(self.segments) - 1)](time)
        return state[1] - state[3]

    def stiffness(self, t):
        return self.settings.stiffness

    def viscosity(self, t):
        return self.settings.viscosity

    def gain(self, t):
        return self.settings.reflex_gain

    def motion(self, t, state, command, disturbance):
        p = self.settings
        servo = (2 * np.pi * p.actuator_frequency) ** 2 * (command - state[0])
        servo -= 2 * p.actuator_damping * 2 * np.pi * p.actuator_frequency * state[1]
        position, velocity = state[0] - state[2], state[1] - state[3]
        passive = self.stiffness(t) * position + self.viscosity(t) * velocity
        load = 0.0
        if p.closed_loop:
            # I_L·l̈ + B_L·l̇ + K_L·l = K·P + B·Ṗ + I·(servo − l̈) + reflex + disturbance
            drive = passive + p.inertia * servo + state[4] + disturbance
            drive -= p.load_viscosity * state[3] + p.load_stiffness * state[2]
            load = drive / (p.load_inertia + p.inertia)
        return servo, load, position, passive + p.inertia * (servo - load)

    def slope(self, t, state, sample):
        p, (command, noise, voluntary) = self.settings, self.external
        out = np.zeros_like(state)
        filters = state[4 + self.order :].reshape(3, 4)
        state = state[: 4 + self.order].tolist()  # plain numbers are faster one by one
        disturbance = noise[sample] + float(np.interp(t, self.time, voluntary))
        servo, load, position, intrinsic = self.motion(
            t, state, float(command[sample]), disturbance
        )
        out[:4] = state[1], servo, state[3], load
        drive = self.gain(t) * max(0.0, self.delayed_velocity(t) - p.reflex_threshold)
        w, z = p.omega_n, p.zeta
        if self.order == 2:
            out[4:6] = state[5], w**2 * (drive - state[4]) - 2 * z * w * state[5]
        else:  # the extra pole behind the second-order low-pass
            out[4] = p.pole * (state[5] - state[4])
            out[5:7] = state[6], w**2 * (drive - state[5]) - 2 * z * w * state[6]
        A, b, _, _ = self.filter
        channels = np.array([[position], [intrinsic], [state[4]]])
        out[4 + self.order :] = (filters @ A.T + channels * b[:, 0]).ravel()
        return out

    def run(self):
        samples = self.external[0].size
        step = round(SEGMENT * RATE)
        state = np.zeros(4 + self.order + 12)
        record = np.zeros((3, samples))
        c = self.filter[2][0]
        for first in range(0, samples, step):
            times = np.arange(first, first + step + 1) / RATE
            solution = solve_ivp(
                self.slope,
                (times[0], times[-1]),
                state,
                "DOP853",
                times,
                True,
                args=(first,),
                rtol=1e-9,
                atol=1e-11,
            )
            self.segments.append(solution.sol)
            for channel in range(3):
                row = 4 + self.order + 4 * channel
                record[channel, first : first + step] = c @ solution.y[row : row + 4, :-1]
            state = solution.y[:, -1]
        return record


@pytest.mark.parametrize(
    ("parameters", "noise"),
    [
        ({"reflex_gain": 25.0, "pole": 50.0, "closed_loop": False, "delay": 0.03125}, 0.0),
        (
            {
                "reflex_gain": 2.0,
                "zeta": 0.7,
                "omega_n": 25.0,
                "load_inertia": 0.1,
                "load_viscosity": 10.0,
            },
            0.5,
        ),
        ({"reflex_gain": 20.0, "reflex_threshold": 0.3}, 1.5),
    ],
    ids=["third order, open loop, half a step of delay", "other load and reflex", "threshold"],
)
def test_loop_against_an_adaptive_solver(parameters, noise):
    external = external_signals(1.2, noise=noise, ramp=0.5 if noise else 0.0)
    expected = append_net(AdaptiveSolution(SimulationSettings(**parameters), *external).run())
    # Only the linear interpolation of the rectified velocity is approximate: its error is of second order.
    for integration_rate, tolerance in ((1e4, 5e-5), (4e4, 3e-6)):
        settings = SimulationSettings(integration_rate=integration_rate, **parameters)
        record = run(settings, *external)
        error = np.max(np.abs(append_net(record) - expected), axis=1) / np.max(
            np.abs(expected), axis=1
        )
        assert np.all(error < tolerance), dict(
            zip(("position", "intrinsic", "reflex", "net"), error, strict=True)
        )


def append_net(record):
    return np.vstack([record, record[1] + record[2]])


def test_a_loop_that_diverges_stops():
    settings, rng = SimulationSettings(position_limit=0.5), np.random.default_rng(1)
    command, noise = 0.04 * (np.repeat(rng.integers(0, 2, 8), 50) - 0.5), rng.standard_normal(400)
    assert np.isfinite(run(settings, command, noise, np.zeros(400))).all()
    command[100:] = 5.0
    with pytest.raises(UnstableLoopError, match=r"passes ±0\.5 rad after 0\.[123]"):
        run(settings, command, noise, np.zeros(400))


@pytest.mark.parametrize("closed_loop", [True, False])
def test_without_a_filter_signals_are_those_behind_a_very_fast_one(closed_loop):
    external = external_signals(1.0, noise=2.0, ramp=3.0)
    records = [
        run(SimulationSettings(antialias_cutoff=cutoff, closed_loop=closed_loop), *external)
        for cutoff in (None, 20_000.0)
    ]
    inside = slice(5, None, 100)  # behind the switches of command and noise
    for bare, filtered in zip(*records, strict=True):
        np.testing.assert_allclose(bare[inside], filtered[inside], atol=1e-3 * np.ptp(bare))
