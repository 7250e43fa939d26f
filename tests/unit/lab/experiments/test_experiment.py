"""What commands tell of a joint: against the Cramér-Rao bound, limits, and the distribution of the dwell times."""

import numpy as np
import pandas as pd
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import (
    DataError,
    cramer_rao,
    design_perturbation,
    identify,
    plan_duration,
    simulate,
)
from ankleloop.simulation.settings import DWELL_TIMES, SimulationSettings
from ankleloop.simulation.simulate import draw_perturbation
from ankleloop_lab.experiments import perturbation
from ankleloop_lab.experiments.experiment import Experiment, describe_joint

LIGHT = {"load": (0.1, 10.0, 100.0), "voluntary": 0.3, "duration": 12.0}


def make_experiment(limits=(), seed=3, **changes):
    joint = {**LIGHT, **changes}
    return Experiment.of(joint, describe_joint("test", joint, {}), dict(limits), seed)


def test_variances_are_those_of_the_bound_without_fed_back_torque():
    """The bound of the same trial, times what an estimated noise spectrum costs: 1.29 at 11.3 s and 0.4 Hz."""
    trial = simulate(seed=8, **{**LIGHT, "voluntary": 0.0}, snr_db=None, antialias_cutoff=None)
    experiment = make_experiment(torque_level=2.0, antialias_cutoff=None, settling=12.0)
    bound = cramer_rao(seed=8, fed_back=False, torque_level=2.0, antialias_cutoff=None, **LIGHT)
    found = experiment.variances([trial["reference"].values])
    ratios = [found[name] / bound[name] ** 2 for name in ("K", "B", "I", "G", "omega_n", "zeta")]
    # The command that precedes the record is another one.
    np.testing.assert_allclose(ratios, np.mean(ratios), rtol=0.01)
    assert 1.15 < np.mean(ratios) < 1.4


def test_the_disturbance_is_absolute():
    """A command twice as large halves the standard deviations; relative to its own torque nothing would change."""
    experiment = make_experiment()
    [command] = experiment.draw({}, 1, count=1)
    once, twice = (experiment.variances([factor * command]) for factor in (1.0, 2.0))
    np.testing.assert_allclose([once[name] / twice[name] for name in once], 4.0, rtol=1e-9)


def test_a_level_of_the_torque_sets_voluntary_torque_and_noise():
    small, large = (
        simulate(seed=2, duration=20.0, voluntary=0.5, torque_level=2.0, amplitude=size)
        for size in (0.02, 0.04)
    )
    for name in ("torque_voluntary", "torque_noise"):
        np.testing.assert_allclose(small[name], large[name], atol=1e-12)
    assert float(small["torque_noise"].std()) == pytest.approx(2.0 * 10**-0.5, rel=0.05)
    bounds = [
        cramer_rao(seed=2, fed_back=False, torque_level=level, **LIGHT) for level in (1.0, 2.0)
    ]
    np.testing.assert_allclose([bounds[1][name] / bounds[0][name] for name in bounds[0]], 2.0)


def test_an_own_command_replaces_the_perturbation():
    trial = simulate(seed=5, duration=6.0, settling=6.0, antialias_cutoff=None)
    command = trial["reference"]
    repeated = simulate(seed=5, duration=6.0, settling=6.0, antialias_cutoff=None, command=command)
    np.testing.assert_array_equal(repeated["reference"], command)
    assert repeated.attrs["perturbation"] == "command"
    # It also precedes the record: the response is that of a command that is periodic.
    twice = simulate(
        seed=5, duration=12.0, settling=0.0, command=np.tile(command, 2), snr_db=None, voluntary=0.0
    )
    once = simulate(seed=5, duration=6.0, settling=6.0, command=command, snr_db=None, voluntary=0.0)
    np.testing.assert_allclose(once["position"], twice["position"][6000:], atol=1e-12)


def test_an_own_command_has_its_own_duration():
    command = 0.01 * np.sin(np.arange(6000) / 300)
    trial = simulate(seed=5, command=command)
    assert trial.attrs["duration"] == 6.0
    assert trial.identical(simulate(seed=5, command=command, duration=6.0))
    assert simulate(seed=5, command=command, recording_rate=2000.0).attrs["duration"] == 3.0


def test_dwell_times_follow_their_weights():
    shares = np.array([0, 4, 1, 0, 0, 2, 0, 1, 1, 0, 1]) / 10
    chosen = SimulationSettings(perturbation="dwells", dwell_weights=shares.tolist())
    command = draw_perturbation(chosen, np.random.default_rng(1), 1_000_000)
    assert set(np.unique(command)) == {-0.02, 0.02}
    dwells = np.diff(np.flatnonzero(np.diff(command))) / 1000
    counts = [np.isclose(dwells, dwell).sum() for dwell in DWELL_TIMES]
    assert sum(counts) == dwells.size
    np.testing.assert_allclose(np.array(counts) / dwells.size, shares, atol=0.025)


@given(
    share=st.floats(0.05, 0.9), name=st.sampled_from(["torque", "servo_velocity", "joint_velocity"])
)
@settings(max_examples=8, deadline=None)
def test_commands_are_within_their_limits(share, name):
    """The limit is a share of what the same command causes without one, and the response is that of the loop."""
    free = make_experiment(duration=4.0)

    def sizes(command):
        clean = free.respond(command)
        servo = simulate(
            seed=0, command=command, closed_loop=False, duration=4.0, snr_db=None, voluntary=0.0
        )
        return {
            "torque": float(np.abs(clean.samples["torque"]).max()),
            "joint_velocity": float(np.abs(np.gradient(clean.samples["position"], 1e-3)).mean()),
            "servo_velocity": float(np.abs(np.gradient(servo["position"].values, 1e-3)).max()),
        }

    [command] = free.draw({}, 2, count=1)
    limit = share * sizes(command)[name]
    [limited] = make_experiment({name: limit}, duration=4.0).draw({}, 2, count=1)
    assert sizes(limited)[name] == pytest.approx(
        limit, rel=0.02
    )  # differences of samples are no derivatives
    np.testing.assert_allclose(limited / command, limited[0] / command[0])


def test_the_spectrum_of_a_pilot_is_that_of_the_simulation():
    pilot = identify(simulate(seed=3, **{**LIGHT, "duration": 60.0}), "riv", delay=0.04)
    chosen = describe_joint("test", pilot, {"load": LIGHT["load"], "duration": 12.0})
    assert chosen.stiffness == pilot.stiffness["K"]
    from_pilot, known = Experiment.of(pilot, chosen, {}, 3), make_experiment()
    commands = known.draw({}, 4, count=2)
    expected, found = known.variances(commands), from_pilot.variances(commands)
    np.testing.assert_allclose([found[name] / expected[name] for name in "KBG"], 1.0, atol=0.3)


def test_a_planned_record_with_a_new_sequence():
    joint = {"load": (0.1, 10.0, 100.0), "voluntary": 0.3}
    design = design_perturbation(joint, progress=lambda generations: [])
    plan = plan_duration(design, {"K": 0.04})
    assert plan.seconds != design.seconds
    command = design.draw(seed=1, seconds=plan.seconds)
    trial = simulate(seed=1, duration=plan.seconds, command=command, **joint)
    assert trial.identical(simulate(seed=1, command=command, **joint))
    assert trial.attrs["duration"] == plan.seconds
    steps = command.values / abs(command[0].item())
    own = design.draw(seed=1)
    assert own.sizes["time"] == 1000 * design.seconds
    shared = min(steps.size, own.size)  # a longer sequence begins as a shorter one
    np.testing.assert_allclose(steps[:shared], (own.values / abs(own[0].item()))[:shared])


def test_a_design_is_better_within_the_same_limits(tmp_path, monkeypatch):
    monkeypatch.setattr(perturbation, "GENERATIONS", 4)
    joint = {"load": (0.1, 10.0, 100.0), "voluntary": 0.3}
    generations = []

    def count(numbers):
        generations.extend(numbers)
        return numbers

    design = design_perturbation(joint, seconds=20.0, servo_velocity=1.0, progress=count)
    assert generations == list(range(4))
    assert max(design.time_ratio.values()) < 0.95
    assert sum(design.weights.values()) == pytest.approx(1.0)
    first, second = design.draw(1), design.draw(2)
    assert first.identical(design.draw(1))
    assert not first.equals(second)
    servo = simulate(seed=1, command=first, duration=20.0, closed_loop=False)
    assert float(np.abs(np.gradient(servo["position"], 1e-3)).max()) < 1.02
    assert float(np.abs(first).max()) == pytest.approx(design.amplitude, rel=0.1)
    level = design.experiment.spectrum.keywords["level"]
    joint = {**joint, "duration": 20.0, "torque_level": level}
    trials = [simulate(seed=seed, command=design.draw(seed), **joint) for seed in range(3)]
    estimates = [identify(trial, "riv", delay=0.04) for trial in trials]
    found = np.mean([estimate.diagnostics["standard_errors"]["K"] for estimate in estimates])
    assert found == pytest.approx(design.standard_errors["K"], rel=0.2)
    design.save(tmp_path / "command.csv", seed=2)
    design.save(tmp_path / "command.mat", seed=2)
    np.testing.assert_allclose(pd.read_csv(tmp_path / "command.csv")["command_rad"], second)
    degrees = design.draw(2, unit="deg")
    assert degrees.attrs["units"] == "deg"
    np.testing.assert_allclose(degrees, np.degrees(second))
    design.save(tmp_path / "degrees.csv", seed=2, unit="deg")
    np.testing.assert_allclose(pd.read_csv(tmp_path / "degrees.csv")["command_deg"], degrees)
    with pytest.raises(ValueError, match="unit must be 'rad' or 'deg'; got 'V'"):
        design.draw(2, unit="V")
    written = scipy.io.loadmat(tmp_path / "command.mat", squeeze_me=True)
    np.testing.assert_allclose(written["command"], second)
    assert written["fs"] == 1000.0
    with pytest.raises(DataError, match="exists already"):
        design.save(tmp_path / "command.csv", seed=3)


def test_a_pilot_without_a_reflex_or_without_its_gain():
    """A passive joint has a gain of zero, whatever its estimate is; a curve that is no ramp has none."""
    trial = simulate(seed=5, duration=20.0, reflex_gain=0.0, voluntary=0.3)
    passive = identify(trial, "riv")
    assert passive.reflex["G"] < 0.0
    assert describe_joint("design", passive, {}).reflex_gain == 0.0
    trial = simulate(seed=5, duration=40.0, reflex_threshold=0.5)
    bent = identify(trial, "riv", basis="spline", degree=8)
    with pytest.raises(DataError, match=r'G: the ramp begins at .* pilot with basis="rectifier"'):
        describe_joint("design", bent, {})
