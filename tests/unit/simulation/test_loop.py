"""The simulator against an adaptive solver, against closed forms, and what it promises about seeds and noise."""

import hashlib
import subprocess
import sys

import numpy as np
import pytest
from scipy import signal as sps
from scipy.integrate import solve_ivp

from ankleloop import UnstableLoopError, simulate
from ankleloop.simulation import Simulation, parameter_table
from ankleloop.simulation.filters import antialias
from ankleloop.simulation.loop import build_loop, run_loop

RATE = 1000.0
PIECE = 0.01  # s: divides the switching interval, the delay and the hold of the noise


def external_signals(seconds, *, noise=0.0, ramp=0.0):
    rng = np.random.default_rng(5)
    samples = round(seconds * RATE)
    command = 0.04 * (np.repeat(rng.integers(0, 2, samples // 100 + 1), 100)[:samples] - 0.5)
    held = noise * np.repeat(rng.standard_normal(samples // 10 + 1), 10)[:samples]
    return command, held, ramp * np.arange(samples) / RATE


def bessel(cutoff):
    # Designed at 1 rad/s and then speeded up: designed in seconds, its output state would be 1e-13 of the output, below
    # the absolute tolerance of the solver.
    A, b, c, d = sps.tf2ss(*sps.bessel(4, 1.0, analog=True, norm="mag"))
    return 2 * np.pi * cutoff * A, 2 * np.pi * cutoff * b, c, d


class Adaptive:
    """The loop written out as physics: servo, load, reflex and three recorder channels, solved piece by piece."""

    def __init__(self, parameters, command, noise, voluntary):
        self.p = parameters
        self.external = command, noise, voluntary
        self.time = np.arange(voluntary.size) / RATE
        self.filter = bessel(parameters["antialias_cutoff"])
        self.pieces = []
        self.order = 2 if parameters["pole"] is None else 3

    def delayed_velocity(self, t):
        past = t - self.p["delay"]
        if past <= 0:
            return 0.0
        # A point between two pieces belongs to the earlier one: velocity is continuous.
        state = self.pieces[min(int(past / PIECE), len(self.pieces) - 1)](past)
        return state[1] - state[3]

    def motion(self, state, command, disturbance):
        p = self.p
        servo = (2 * np.pi * p["actuator_frequency"]) ** 2 * (command - state[0])
        servo -= 2 * p["actuator_damping"] * 2 * np.pi * p["actuator_frequency"] * state[1]
        position, velocity = state[0] - state[2], state[1] - state[3]
        passive = p["stiffness"] * position + p["viscosity"] * velocity
        give = 0.0
        if p["closed_loop"]:
            # I_L·l̈ + B_L·l̇ + K_L·l = K·P + B·Ṗ + I·(servo − l̈) + rest
            drive = passive + p["inertia"] * servo + state[4] + disturbance
            drive -= p["load_viscosity"] * state[3] + p["load_stiffness"] * state[2]
            give = drive / (p["load_inertia"] + p["inertia"])
        acceleration = servo - give
        return servo, give, position, passive + p["inertia"] * acceleration

    def slope(self, t, state, sample):
        p, (command, noise, voluntary) = self.p, self.external
        out = np.zeros_like(state)
        filters = state[4 + self.order :].reshape(3, 4)
        state = state[: 4 + self.order].tolist()  # plain numbers are faster one by one
        disturbance = noise[sample] + float(np.interp(t, self.time, voluntary))
        servo, give, position, intrinsic = self.motion(state, float(command[sample]), disturbance)
        out[:4] = state[1], servo, state[3], give
        drive = p["reflex_gain"] * max(0.0, self.delayed_velocity(t))
        w, z = p["omega_n"], p["zeta"]
        if self.order == 2:
            out[4:6] = state[5], w**2 * (drive - state[4]) - 2 * z * w * state[5]
        else:  # the extra pole behind the second-order low-pass
            out[4] = p["pole"] * (state[5] - state[4])
            out[5:7] = state[6], w**2 * (drive - state[5]) - 2 * z * w * state[6]
        A, b, _, _ = self.filter
        channels = np.array([[position], [intrinsic], [state[4]]])
        out[4 + self.order :] = (filters @ A.T + channels * b[:, 0]).ravel()
        return out

    def run(self):
        samples = self.external[0].size
        step = round(PIECE * RATE)
        state = np.zeros(4 + self.order + 12)
        recorded = np.zeros((3, samples))
        c = self.filter[2][0]
        for first in range(0, samples, step):
            times = np.arange(first, first + step + 1) / RATE
            solved = solve_ivp(
                self.slope, (times[0], times[-1]), state, "DOP853", times, True, args=(first,), rtol=1e-9, atol=1e-11
            )
            self.pieces.append(solved.sol)
            for channel in range(3):
                at = 4 + self.order + 4 * channel
                recorded[channel, first : first + step] = c @ solved.y[at : at + 4, :-1]
            state = solved.y[:, -1]
        return recorded


@pytest.mark.parametrize(
    ("parameters", "noise"),
    [
        ({"reflex_gain": 13.0}, 0.0),
        ({"reflex_gain": 25.0, "pole": 50.0}, 0.0),
        ({"reflex_gain": 13.0, "closed_loop": False}, 0.0),
        ({"reflex_gain": 13.0}, 1.5),
        ({"reflex_gain": 2.0, "zeta": 0.7, "omega_n": 25.0, "load_inertia": 0.1, "load_viscosity": 10.0}, 0.5),
        ({"reflex_gain": 20.0, "delay": 0.03125}, 0.0),
    ],
    ids=["second order", "third order", "open loop", "noise fed back", "other load and reflex", "half a step of delay"],
)
def test_loop_against_an_adaptive_solver(parameters, noise):
    external = external_signals(2.0, noise=noise, ramp=0.5 if noise else 0.0)
    expected = with_net(Adaptive(Simulation.from_flat(**parameters).flat(), *external).run())
    # Only the linear interpolation of the rectified velocity is approximate: its error is of second order.
    for integration_rate, tolerance in ((1e4, 5e-5), (4e4, 3e-6)):
        simulation = Simulation.from_flat(integration_rate=integration_rate, **parameters)
        recorded, diverged = run_loop(build_loop(simulation), simulation, *external)
        assert diverged == -1
        error = np.max(np.abs(with_net(recorded) - expected), axis=1) / np.max(np.abs(expected), axis=1)
        assert np.all(error < tolerance), dict(zip(("position", "intrinsic", "reflex", "net"), error, strict=True))


def with_net(recorded):
    return np.vstack([recorded, recorded[1] + recorded[2]])


@pytest.mark.parametrize("options", [{}, {"closed_loop": False, "reflex_gain": 25.0}], ids=["closed", "open"])
def test_a_whole_trial_against_an_adaptive_solver(options):
    """Command and noise are read off the record itself: what drives the loop is what the trial says drives it."""
    trial = simulate(seed=11, duration=1.0, settling=0.0, voluntary=0.0, **options)
    command = np.repeat(0.02 * np.sign(trial["reference"].values[50::100]), 100)
    settled = trial["torque_noise"].values[10::10]  # the end of each hold: the recorder has settled to 1e-5
    noise = np.repeat(np.append(settled, 0.0), 10)  # the last hold has no end
    parameters = {name: trial.attrs.get(name) for name in parameter_table()}
    expected = Adaptive(parameters, command, noise, np.zeros(noise.size)).run()[:, :-10]
    expected = np.vstack([expected, expected[1] + expected[2] + trial["torque_noise"].values[:-10]])
    names = ("position", "torque_intrinsic", "torque_reflex", "torque")
    recorded = np.array([trial[name].values[:-10] for name in names])
    error = np.max(np.abs(recorded - expected), axis=1) / np.max(np.abs(expected), axis=1)
    assert np.all(error < 1e-4), dict(zip(names, error, strict=True))


@pytest.mark.parametrize("closed_loop", [True, False])
def test_torque_that_is_fed_back_has_its_transfer_function(closed_loop):
    """Without reflex or command, P = −H_imp / (1 + H_imp · joint) times noise and voluntary torque."""
    simulation = Simulation.from_flat(reflex_gain=0.0, closed_loop=closed_loop)
    command, noise, ramp = external_signals(1.0, noise=2.0, ramp=3.0)
    recorded, _ = run_loop(build_loop(simulation), simulation, 0 * command, noise, ramp)
    if not closed_loop:
        np.testing.assert_array_equal(recorded, 0.0)
        return
    b, a = sps.bessel(4, 2 * np.pi * 200.0, analog=True, norm="mag")
    joint, moved = [0.015, 0.8, 150.0], np.polymul([1.115, 7.9, 400.0], a)
    time = np.arange(noise.size) / RATE
    for channel, factor in ((0, [1.0]), (1, joint)):
        numerator = -np.polymul(b, factor)
        # A pole at 0 makes the step response, the integral of which is the ramp response.
        residues, poles, _ = sps.residue(numerator, np.polymul(moved, [1.0, 0.0]))
        step = (residues[:, None] * np.exp(poles[:, None] * time)).sum(axis=0).real
        moving = np.abs(poles) > 1e-6
        ramped = residues[~moving].real.sum() * time
        ramped += (residues[moving, None] / poles[moving, None] * np.expm1(poles[moving, None] * time)).sum(axis=0).real
        expected = np.convolve(np.diff(noise, prepend=0.0), step)[: noise.size] + 3.0 * ramped
        assert np.max(np.abs(recorded[channel] - expected)) < 1e-7 * np.max(np.abs(expected))


@pytest.mark.parametrize("closed_loop", [True, False])
def test_loop_without_reflex_is_its_transfer_function(closed_loop):
    """Every switch of the command adds the step response of the closed form, by partial fractions."""
    simulation = Simulation.from_flat(reflex_gain=0.0, closed_loop=closed_loop)
    command, nothing, _ = external_signals(3.0)
    recorded, _ = run_loop(build_loop(simulation), simulation, command, nothing, nothing)
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
        error = np.max(np.abs(recorded[channel] - expected)) / np.max(np.abs(expected))
        assert error < 1e-7


def test_external_signals_pass_the_same_recorder():
    simulation = Simulation()
    _, noise, ramp = external_signals(1.0, noise=1.0, ramp=2.0)
    A, b, c, _ = bessel(200.0)
    for x, hold in ((noise, "zoh"), (ramp, "foh")):
        time = np.arange(x.size) / RATE
        fine = np.linspace(0, time[-1], 20 * (x.size - 1) + 1)
        finely = np.repeat(x[:-1], 20) if hold == "zoh" else np.interp(fine, time, x)[:-1]
        F, g, _, _, _ = sps.cont2discrete((A, b, c, 0), fine[1], method="zoh" if hold == "zoh" else "foh")
        if hold == "foh":  # a straight line through the low-pass lags behind by its delay, exactly, once settled
            lag = np.sum(np.real(-1 / np.linalg.eigvals(A)))
            assert antialias(x, simulation, hold)[-1] == pytest.approx(2.0 * (time[-1] - lag), rel=1e-9)
            continue
        state, expected = np.zeros(4), []
        for k, value in enumerate(finely):
            if k % 20 == 0:
                expected.append(float(c[0] @ state))
            state = F @ state + g[:, 0] * value
        np.testing.assert_allclose(antialias(x, simulation, hold)[: len(expected)], expected, atol=1e-9)


def test_same_seed_same_bits():
    first, second, other = (simulate(seed=seed, duration=5.0) for seed in (7, 7, 8))
    assert first.identical(second)
    assert simulate(seed=np.random.SeedSequence(7), duration=5.0)["torque"].identical(first["torque"])
    assert not np.array_equal(first["reference"], other["reference"])
    script = (
        "import ankleloop, hashlib;"
        "print(hashlib.sha256(ankleloop.simulate(seed=7, duration=5.0)['torque'].values.tobytes()).hexdigest())"
    )
    here = hashlib.sha256(first["torque"].values.tobytes()).hexdigest()
    there = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert there.stdout.strip() == here


def test_a_seed_sequence_is_not_used_up():
    seed = np.random.SeedSequence([1, 2, 3])
    assert simulate(seed=seed, duration=5.0).identical(simulate(seed=seed, duration=5.0))
    assert seed.n_children_spawned == 0
    np.testing.assert_array_equal(seed.generate_state(4), np.random.SeedSequence([1, 2, 3]).generate_state(4))
    children = [simulate(seed=child, duration=5.0)["torque"].values for child in seed.spawn(2)]
    assert not np.array_equal(*children)


def test_signals_have_streams_of_their_own():
    plain = simulate(seed=3, duration=5.0, snr_db=None, voluntary=0.0)
    noisy = simulate(seed=3, duration=5.0, snr_db=10.0, voluntary=0.3)
    louder = simulate(seed=3, duration=5.0, snr_db=10.0, voluntary=0.6)
    np.testing.assert_array_equal(plain["reference"], noisy["reference"])
    np.testing.assert_array_equal(noisy["torque_noise"], louder["torque_noise"])
    np.testing.assert_allclose(louder["torque_voluntary"], 2 * noisy["torque_voluntary"], rtol=1e-12)
    streams = [noisy[name].values for name in ("reference", "torque_voluntary", "torque_noise")]
    assert np.max(np.abs(np.corrcoef(streams) - np.eye(3))) < 0.25
    other_joint = simulate(seed=3, duration=7.0, reflex_gain=2.0, load=(1.0, 20.0, 300.0))
    np.testing.assert_array_equal(other_joint["reference"][:5000], plain["reference"])


def test_torque_is_the_sum_of_its_parts():
    trial = simulate(seed=4, duration=5.0, voluntary=0.5)
    parts = sum(trial[f"torque_{name}"] for name in ("intrinsic", "reflex", "voluntary", "noise"))
    np.testing.assert_allclose(trial["torque"], parts, atol=1e-12)
    assert trial["torque_intrinsic"].attrs["units"] == "N·m"
    assert trial.attrs["load_inertia"] == 1.1


def test_noise_and_voluntary_torque_have_their_levels():
    levels = []
    for seed in range(10):
        clean = simulate(seed=seed, snr_db=None, voluntary=0.0)["torque"].values
        trial = simulate(seed=seed, snr_db=10.0, voluntary=0.4)
        levels.append([trial[f"torque_{part}"].values.var() / clean.var() for part in ("noise", "voluntary")])
    noise, voluntary = np.mean(levels, axis=0)
    assert noise == pytest.approx(0.1, rel=0.02)
    assert voluntary == pytest.approx(0.16, rel=0.15)


def test_voluntary_torque_is_slow_and_noise_is_white_below_its_rate():
    trial = simulate(seed=1, duration=200.0, voluntary=0.5)
    frequency, power = sps.welch(trial["torque_voluntary"], RATE, nperseg=8192)
    assert power[frequency > 10].sum() < 0.01 * power.sum()
    held = trial["torque_noise"].values[9::10]
    correlation = np.correlate(held, held, "full")[held.size - 1 :][1:6] / (held @ held)
    assert np.max(np.abs(correlation)) < 0.05


def test_in_open_loop_torque_does_not_move_the_joint():
    quiet = simulate(seed=2, duration=5.0, closed_loop=False, snr_db=None, voluntary=0.0)
    noisy = simulate(seed=2, duration=5.0, closed_loop=False, snr_db=0.0, voluntary=1.0)
    np.testing.assert_array_equal(quiet["position"], noisy["position"])
    closed = [simulate(seed=2, duration=5.0, snr_db=db)["position"].values for db in (None, 0.0)]
    assert np.std(closed[0] - closed[1]) > 0.01 * np.std(closed[0])


def test_settling_is_simulated_and_dropped():
    whole = simulate(seed=2, duration=10.0, settling=0.0, snr_db=None, voluntary=0.0)
    settled = simulate(seed=2, duration=5.0, settling=5.0, snr_db=None, voluntary=0.0)
    np.testing.assert_array_equal(whole["position"][5000:], settled["position"])
    assert float(settled["time"][0]) == 0.0


def test_finer_integration_changes_nothing_that_matters():
    coarse, fine = (simulate(seed=1, duration=5.0, reflex_gain=25.0, integration_rate=r) for r in (1e4, 4e4))
    for name in ("position", "torque"):
        scale = np.max(np.abs(fine[name].values))
        np.testing.assert_allclose(coarse[name], fine[name], atol=5e-5 * scale)


def test_an_unstable_loop_names_its_parameters():
    with pytest.raises(UnstableLoopError) as error:
        simulate(seed=1, load=(0.1, 5.0, 100.0), reflex_gain=30.0)
    for name in ("load_inertia=0.1", "load_viscosity=5", "load_stiffness=100", "reflex_gain=30", "delay=0.04"):
        assert name in str(error.value)


@pytest.mark.parametrize("gain", [10.0, 20.0, 30.0])
def test_the_assumed_load_is_stable_for_every_gain_of_the_paper(gain):
    assert np.all(np.isfinite(simulate(seed=1, reflex_gain=gain)["torque"]))


@pytest.mark.parametrize(
    ("parameters", "kind", "message"),
    [
        ({"stiffnes": 150.0}, TypeError, "stiffnes.*known: stiffness"),
        ({"inertia": -0.1}, ValueError, "inertia must be at least 0"),
        ({"delay": 0.0005}, ValueError, "delay must be at least one recorded sample"),
        ({"switching_interval": 0.0105}, ValueError, "switching_interval"),
        ({"noise_rate": 300.0}, ValueError, "noise_rate"),
        ({"integration_rate": 1500.0}, ValueError, "integration_rate"),
        ({"voluntary": "much"}, ValueError, "voluntary must be a finite number"),
        ({"omega_n": float("nan")}, ValueError, "omega_n must be a finite number"),
        ({"closed_loop": "yes"}, ValueError, "closed_loop must be true or false"),
        ({"duration": 0.0}, ValueError, "duration must be above 0"),
        ({"load": (0.0, 7.1, 250.0)}, ValueError, "load_inertia must be above 0"),
        ({"load": (1.1, 7.1)}, (TypeError, ValueError), "load"),
        ({"load": 1.1}, (TypeError, ValueError), "load"),
        ({"inertia": 1j}, (TypeError, ValueError), "inertia"),
        ({"voluntary_cutoff": 600.0}, ValueError, "voluntary_cutoff"),
    ],
)
def test_wrong_parameters_are_named(parameters, kind, message):
    with pytest.raises(kind, match=message):
        simulate(seed=1, **parameters)


def test_parameters_of_the_paper():
    table = parameter_table()
    published = {
        "stiffness": 150.0, "viscosity": 0.8, "inertia": 0.015, "omega_n": 40.0, "zeta": 1.0, "delay": 0.04,
        "amplitude": 0.04, "switching_interval": 0.1, "voluntary_cutoff": 2.0, "snr_db": 10.0, "duration": 50.0,
    }  # fmt: skip
    assert {name: table[name]["default"] for name in published} == published
    assert all(entry["unit"] and entry["description"] for entry in table.values())
