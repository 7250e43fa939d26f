"""The simulated loop against an adaptive solver and against closed forms."""

import numpy as np
import pytest
from scipy import signal as sps
from scipy.integrate import solve_ivp

from ankleloop import UnstableLoopError, simulate
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
    external = external_signals(2.0, noise=noise, ramp=0.5 if noise else 0.0)
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


def test_a_whole_trial_against_an_adaptive_solver():
    """Command and noise come from the signals of the trial: they are the ones that drove the loop."""
    settings = SimulationSettings(duration=1.0, settling=0.0, voluntary=0.0)
    trial = simulate(seed=11, **dict(settings))
    command = np.repeat(0.02 * np.sign(trial["reference"].values[50::100]), 100)
    levels = trial["torque_noise"].values[
        10::10
    ]  # at the end of each hold: the recorder has settled to 1e-5
    noise = np.repeat(np.append(levels, 0.0), 10)  # the last hold has no end
    expected = AdaptiveSolution(settings, command, noise, np.zeros(noise.size)).run()[:, :-10]
    expected = np.vstack([expected, expected[1] + expected[2] + trial["torque_noise"].values[:-10]])
    names = ("position", "torque_intrinsic", "torque_reflex", "torque")
    record = np.array([trial[name].values[:-10] for name in names])
    error = np.max(np.abs(record - expected), axis=1) / np.max(np.abs(expected), axis=1)
    assert np.all(error < 1e-4), dict(zip(names, error, strict=True))


def respond_to_steps_and_ramps(numerator, denominator, time):
    """Responses of a transfer function by partial fractions; at time zero they are those after the step."""
    # A pole at 0 makes the step response, the integral of which is the ramp response.
    residues, poles, _ = sps.residue(numerator, np.polymul(denominator, [1.0, 0.0]))
    step = (residues[:, None] * np.exp(poles[:, None] * time)).sum(axis=0).real
    at_zero = np.abs(poles) <= 1e-6
    ramp = residues[at_zero].real.sum() * time
    residues, poles = residues[~at_zero, None], poles[~at_zero, None]
    return step, ramp + (residues / poles * np.expm1(poles * time)).sum(axis=0).real


@pytest.mark.parametrize("closed_loop", [True, False])
@pytest.mark.parametrize(("cutoff", "accuracy"), [(200.0, 1e-7), (None, 1e-8)])
def test_the_loop_without_reflex_has_its_transfer_functions(closed_loop, cutoff, accuracy):
    """P = servo / (1 + H_imp · joint) · r − H_imp / (1 + H_imp · joint) times noise and voluntary torque."""
    settings = SimulationSettings(reflex_gain=0.0, closed_loop=closed_loop, antialias_cutoff=cutoff)
    command, noise, ramp = external_signals(2.0, noise=2.0, ramp=3.0)
    time = np.arange(noise.size) / RATE
    w = 2 * np.pi * 20.0
    servo, joint, load = [1.0, 1.6 * w, w**2], [0.015, 0.8, 150.0], [1.1, 7.1, 250.0]
    b, a = sps.bessel(4, 2 * np.pi * cutoff, analog=True, norm="mag") if cutoff else ([1.0], [1.0])
    for channel, factor in ((0, b), (1, np.polymul(b, joint))):
        numerator, denominator, expected = w**2 * np.array(factor), np.polymul(servo, a), 0.0
        if closed_loop:
            total = np.polyadd(load, joint)
            numerator, denominator = np.polymul(numerator, load), np.polymul(denominator, total)
            step, slope = respond_to_steps_and_ramps(-np.array(factor), np.polymul(total, a), time)
            expected = np.convolve(np.diff(noise, prepend=0.0), step)[: time.size] + 3.0 * slope
        step, _ = respond_to_steps_and_ramps(numerator, denominator, time)
        expected = expected + np.convolve(np.diff(command, prepend=0.0), step)[: time.size]
        record = run(settings, command, noise, ramp)[channel]
        np.testing.assert_allclose(record, expected, rtol=0, atol=accuracy * np.abs(expected).max())
