"""The simulated loop against an adaptive solver and against closed forms."""

import numpy as np
import pytest
from scipy import signal as sps
from scipy.integrate import solve_ivp

from ankleloop import UnstableLoopError, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.simulation.filters import antialias
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
        p = self.settings
        return p.stiffness * (1.0 + p.stiffness_drift * (t / p.duration - 0.5))

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
        servo, load, position, intrinsic = self.motion(t, state, float(command[sample]), disturbance)
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
                self.slope, (times[0], times[-1]), state, "DOP853", times, True, args=(first,), rtol=1e-9, atol=1e-11
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
        ({"reflex_gain": 13.0}, 0.0),
        ({"reflex_gain": 25.0, "pole": 50.0}, 0.0),
        ({"reflex_gain": 13.0, "closed_loop": False}, 0.0),
        ({"reflex_gain": 13.0}, 1.5),
        ({"reflex_gain": 2.0, "zeta": 0.7, "omega_n": 25.0, "load_inertia": 0.1, "load_viscosity": 10.0}, 0.5),
        ({"reflex_gain": 20.0, "delay": 0.03125}, 0.0),
        ({"reflex_gain": 20.0, "reflex_threshold": 0.3}, 0.5),
        ({"stiffness_drift": 0.2, "duration": 2.0, "settling": 0.0}, 0.5),
        ({"stiffness_drift": -1.5, "duration": 2.0, "settling": 0.0, "closed_loop": False}, 0.0),
    ],
    ids=[
        "second order",
        "third order",
        "open loop",
        "noise fed back",
        "other load and reflex",
        "half a step of delay",
        "threshold",
        "drift",
        "drift in open loop",
    ],
)
def test_loop_against_an_adaptive_solver(parameters, noise):
    external = external_signals(2.0, noise=noise, ramp=0.5 if noise else 0.0)
    expected = append_net(AdaptiveSolution(SimulationSettings(**parameters), *external).run())
    # Only the linear interpolation of the rectified velocity is approximate: its error is of second order.
    for integration_rate, tolerance in ((1e4, 5e-5), (4e4, 3e-6)):
        settings = SimulationSettings(integration_rate=integration_rate, **parameters)
        record = run(settings, *external)
        error = np.max(np.abs(append_net(record) - expected), axis=1) / np.max(np.abs(expected), axis=1)
        assert np.all(error < tolerance), dict(zip(("position", "intrinsic", "reflex", "net"), error, strict=True))


def append_net(record):
    return np.vstack([record, record[1] + record[2]])


def test_a_loop_that_diverges_stops():
    settings, rng = SimulationSettings(position_limit=0.5), np.random.default_rng(1)
    command, noise = 0.04 * (np.repeat(rng.integers(0, 2, 8), 50) - 0.5), rng.standard_normal(400)
    assert np.isfinite(run(settings, command, noise, np.zeros(400))).all()
    command[100:] = 5.0
    with pytest.raises(UnstableLoopError, match=r"passes ±0\.5 rad after 0\.[123]"):
        run(settings, command, noise, np.zeros(400))


@pytest.mark.parametrize("settings", [{}, {"closed_loop": False, "reflex_gain": 25.0}], ids=["closed", "open"])
def test_a_whole_trial_against_an_adaptive_solver(settings):
    """Command and noise come from the signals of the trial: they are the ones that drove the loop."""
    settings = SimulationSettings(duration=1.0, settling=0.0, voluntary=0.0, **settings)
    trial = simulate(seed=11, **dict(settings))
    command = np.repeat(0.02 * np.sign(trial["reference"].values[50::100]), 100)
    levels = trial["torque_noise"].values[10::10]  # at the end of each hold: the recorder has settled to 1e-5
    noise = np.repeat(np.append(levels, 0.0), 10)  # the last hold has no end
    expected = AdaptiveSolution(settings, command, noise, np.zeros(noise.size)).run()[:, :-10]
    expected = np.vstack([expected, expected[1] + expected[2] + trial["torque_noise"].values[:-10]])
    names = ("position", "torque_intrinsic", "torque_reflex", "torque")
    record = np.array([trial[name].values[:-10] for name in names])
    error = np.max(np.abs(record - expected), axis=1) / np.max(np.abs(expected), axis=1)
    assert np.all(error < 1e-4), dict(zip(names, error, strict=True))


@pytest.mark.parametrize("closed_loop", [True, False])
def test_fed_back_torque_has_its_transfer_function(closed_loop):
    """Without reflex or command, P = −H_imp / (1 + H_imp · joint) times noise and voluntary torque."""
    settings = SimulationSettings(reflex_gain=0.0, closed_loop=closed_loop)
    command, noise, ramp = external_signals(1.0, noise=2.0, ramp=3.0)
    record = run(settings, 0 * command, noise, ramp)
    if not closed_loop:
        np.testing.assert_array_equal(record, 0.0)
        return
    b, a = sps.bessel(4, 2 * np.pi * 200.0, analog=True, norm="mag")
    joint, denominator = [0.015, 0.8, 150.0], np.polymul([1.115, 7.9, 400.0], a)
    time = np.arange(noise.size) / RATE
    for channel, factor in ((0, [1.0]), (1, joint)):
        numerator = -np.polymul(b, factor)
        # A pole at 0 makes the step response, the integral of which is the ramp response.
        residues, poles, _ = sps.residue(numerator, np.polymul(denominator, [1.0, 0.0]))
        step = (residues[:, None] * np.exp(poles[:, None] * time)).sum(axis=0).real
        at_zero = np.abs(poles) <= 1e-6
        ramp_response = residues[at_zero].real.sum() * time
        residues, poles = residues[~at_zero, None], poles[~at_zero, None]
        ramp_response += (residues / poles * np.expm1(poles * time)).sum(axis=0).real
        expected = np.convolve(np.diff(noise, prepend=0.0), step)[: noise.size] + 3.0 * ramp_response
        assert np.max(np.abs(record[channel] - expected)) < 1e-7 * np.max(np.abs(expected))


@pytest.mark.parametrize("closed_loop", [True, False])
def test_the_loop_without_reflex_has_its_transfer_function(closed_loop):
    """Every switch of the command adds the step response of the closed form, by partial fractions."""
    settings = SimulationSettings(reflex_gain=0.0, closed_loop=closed_loop)
    command, silence, _ = external_signals(3.0)
    record = run(settings, command, silence, silence)
    w = 2 * np.pi * 20.0
    joint, load = [0.015, 0.8, 150.0], [1.1, 7.1, 250.0]
    numerator, denominator = [w**2], [1.0, 2 * 0.8 * w, w**2]
    if closed_loop:  # P = servo / (1 + H_imp · joint) · r
        numerator, denominator = np.polymul(numerator, load), np.polymul(denominator, np.polyadd(load, joint))
    b, a = sps.bessel(4, 2 * np.pi * 200.0, analog=True, norm="mag")
    numerator, denominator = np.polymul(numerator, b), np.polymul(denominator, a)
    steps = np.diff(command, prepend=0.0)
    time = np.arange(command.size) / RATE
    for channel, factor in ((0, [1.0]), (1, joint)):
        residues, poles, _ = sps.residue(np.polymul(numerator, factor), np.polymul(denominator, [1.0, 0.0]))
        step_response = (residues[:, None] * np.exp(poles[:, None] * time)).sum(axis=0).real
        expected = np.convolve(steps, step_response)[: command.size]
        error = np.max(np.abs(record[channel] - expected)) / np.max(np.abs(expected))
        assert error < 1e-7


def test_external_signals_pass_the_same_recorder():
    settings = SimulationSettings()
    _, noise, ramp = external_signals(1.0, noise=1.0, ramp=2.0)
    A, b, c, _ = bessel(200.0)
    for x, hold in ((noise, "zoh"), (ramp, "foh")):
        time = np.arange(x.size) / RATE
        fine = np.linspace(0, time[-1], 20 * (x.size - 1) + 1)
        levels = np.repeat(x[:-1], 20) if hold == "zoh" else np.interp(fine, time, x)[:-1]
        F, g, _, _, _ = sps.cont2discrete((A, b, c, 0), fine[1], method="zoh" if hold == "zoh" else "foh")
        if hold == "foh":  # a straight line through the low-pass lags behind by its delay, exactly, once settled
            lag = np.sum(np.real(-1 / np.linalg.eigvals(A)))
            assert antialias(x, settings, hold)[-1] == pytest.approx(2.0 * (time[-1] - lag), rel=1e-9)
            continue
        state, expected = np.zeros(4), []
        for k, value in enumerate(levels):
            if k % 20 == 0:
                expected.append(float(c[0] @ state))
            state = F @ state + g[:, 0] * value
        np.testing.assert_allclose(antialias(x, settings, hold)[: len(expected)], expected, atol=1e-9)


@pytest.mark.parametrize(("antialias_cutoff", "accuracy"), [(200.0, 0.005), (None, 0.01)])
def test_a_drift_of_the_stiffness_within_the_record(antialias_cutoff, accuracy):
    """Each second has the stiffness of its middle; without the filter the acceleration aliases."""
    settings = {"reflex_gain": 0.0, "snr_db": None, "voluntary": 0.0, "duration": 8.0, "settling": 1.0, "seed": 3}
    trial = prepare(simulate(stiffness_drift=0.2, antialias_cutoff=antialias_cutoff, **settings))
    regressors = trial.regressors(delay=0.04, basis="rectifier", identification_rate=100.0)
    torque = trial.channel_at("torque_intrinsic", regressors.time, 100.0)
    for start in (1.0, 3.5, 6.0):
        rows = (regressors.time >= start) & (regressors.time < start + 1.0)
        estimate = np.linalg.lstsq(regressors.inputs[rows, :3], torque[rows], rcond=None)[0][0]
        assert estimate == pytest.approx(150.0 * (1.0 + 0.2 * ((start + 0.5) / 8.0 - 0.5)), rel=accuracy)


def test_a_threshold_lowers_the_reflex():
    trials = [simulate(seed=2, duration=5.0, reflex_threshold=threshold) for threshold in (0.0, 0.2, 50.0)]
    sizes = [float(trial["torque_reflex"].std()) for trial in trials]
    assert sizes[0] > 1.1 * sizes[1] > 0.0
    assert sizes[2] == 0.0
