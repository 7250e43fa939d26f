"""Joints that change within a record: against an adaptive solver, and in the trials that they make."""

import numpy as np
import pytest
from test_loop import AdaptiveSolution, append_net, external_signals, run

from ankleloop import DataError, simulate
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import draw_course, trajectories

RATE = 1000.0
LIGHT = {"load_inertia": 0.1, "load_viscosity": 10.0, "load_stiffness": 100.0}
VARIATION = {
    "stiffness_variation": 0.5,
    "stiffness_peak": 0.3,
    "viscosity_variation": 0.4,
    "gain_variation": 0.7,
    "settling": 0.0,
    "duration": 1.0,
}
QUIET = {"voluntary": 0.0, "snr_db": None}


class ChangingJoint(AdaptiveSolution):
    """The equations of motion with K, B and G as functions of time."""

    def __init__(self, settings, course, *external):
        super().__init__(settings, *external)
        self.course = course
        self.latest = None, None

    def at(self, t):
        if self.latest[0] != t:
            self.latest = (
                t,
                [float(values[0]) for values in trajectories(self.course, np.array([t]))],
            )
        return self.latest[1]

    def stiffness(self, t):
        return self.at(t)[0]

    def viscosity(self, t):
        return self.at(t)[1]

    def gain(self, t):
        return self.at(t)[2]


@pytest.mark.parametrize(
    ("parameters", "noise"),
    [
        ({"variation": "cycle", "cycle_duration": 0.4, "gain_peak": 0.8, **LIGHT}, 0.5),
        (
            {
                "variation": "time",
                "variation_shape": "square",
                "closed_loop": False,
                "gain_peak": 0.3,
            },
            0.0,
        ),
    ],
    ids=["cycle, light load", "square wave over time, open loop"],
)
def test_a_changing_joint_against_an_adaptive_solver(parameters, noise):
    """K, B and G are constant over each recorded sample: the error falls with its square."""
    external = external_signals(0.8, noise=noise, ramp=0.5 if noise else 0.0)
    course = draw_course(SimulationSettings(**VARIATION, **parameters), np.random.default_rng(3))
    expected = append_net(ChangingJoint(course.settings, course, *external).run())
    for integration_rate, factor, tolerance in ((1e4, 1, 5e-5), (4e4, 4, 5e-6)):
        settings = SimulationSettings(
            integration_rate=integration_rate,
            recording_rate=factor * RATE,
            **VARIATION,
            **parameters,
        )
        record = run(settings, *refine(factor, *external), course=course)
        error = np.max(np.abs(append_net(record[:, ::factor]) - expected), axis=1) / np.max(
            np.abs(expected), axis=1
        )
        assert np.all(error < tolerance), dict(
            zip(("position", "intrinsic", "reflex", "net"), error, strict=True)
        )


def refine(factor, command, noise, voluntary):
    """Steps of command and noise, and the line of the voluntary torque, at a multiple of their rate."""
    places = np.arange(factor * voluntary.size) / factor
    line = np.interp(places, np.arange(voluntary.size), voluntary)
    return np.repeat(command, factor), np.repeat(noise, factor), line


def test_durations_of_cycles():
    settings = SimulationSettings(variation="cycle", cycle_jitter=0.2, duration=50.0)
    course = draw_course(settings, np.random.default_rng(1))
    durations = np.diff(course.onsets)
    assert course.onsets[0] <= -5.0
    assert course.onsets[-1] >= 50.0
    assert 1.12 <= durations.min() < 1.2
    assert 1.6 < durations.max() <= 1.68
    time = course.onsets[:-1] + 0.25 * durations
    np.testing.assert_allclose(course.phase(time), 0.25, atol=1e-12)


def test_tables_are_joined_by_straight_lines():
    table = {
        "stiffness_table": [100.0, 200.0, 150.0, 150.0],
        "gain_table": (5.0, 10.0),
        "cycle_duration": 1.0,
    }
    cycle = simulate(seed=1, duration=3.0, variation="cycle", **table)
    values = cycle["stiffness_true"].values[[0, 125, 250, 375, 500, 875]]
    np.testing.assert_allclose(values, [100.0, 150.0, 200.0, 175.0, 150.0, 125.0])
    assert cycle.attrs["stiffness_table"] == "100.0, 200.0, 150.0, 150.0"
    text = {**table, "stiffness_table": cycle.attrs["stiffness_table"]}
    assert simulate(seed=1, duration=3.0, variation="cycle", **text).identical(cycle)
    time = simulate(seed=1, duration=3.0, variation="time", **table)
    np.testing.assert_allclose(time["reflex_gain_true"].values[[0, 1500]], [5.0, 7.5])
    assert np.ptp(time["viscosity_true"].values) == 0.0


def test_movement_and_locked_torque_repeat_with_the_cycle():
    settings = {"duration": 8.0, "variation": "cycle", "cycle_duration": 1.0, **QUIET}
    moving = simulate(seed=2, movement=0.3, locked_torque=0.5, amplitude=1e-6, **settings)
    for name in ("reference", "torque_voluntary"):
        cycles = moving[name].values.reshape(8, 1000)
        assert np.ptp(cycles, axis=0).max() < 1e-3 * np.ptp(cycles)
    assert np.ptp(moving["reference"].values) == pytest.approx(0.3, rel=0.02)
    still = simulate(seed=2, **settings)
    level = float(np.std(still["torque"].values))
    locked = simulate(seed=2, locked_torque=0.5, movement=0.3, **settings)["torque_voluntary"]
    assert float(locked.std()) == pytest.approx(0.5 * level, rel=0.02)


@pytest.mark.parametrize("settling", [0.0, 5.0])
def test_a_locked_perturbation_whose_cycle_is_longer_than_the_record(settling):
    """The cycle begins with the record, as it does where it ends within it."""
    settings = {"perturbation_locked": True, "cycle_duration": 12.0, "settling": settling}
    long = simulate(seed=1, duration=24.0, variation="cycle", **settings)
    settings["cycle_duration"] = 100.0
    short = simulate(seed=1, duration=10.0, variation="cycle", **settings)
    inside = slice(100, 10_000)  # what precedes the record is still in the recorder's filter before
    np.testing.assert_allclose(short["reference"][inside], long["reference"][inside], atol=1e-12)
    assert float(short["phase"].max()) == pytest.approx(0.1, rel=1e-3)


def test_the_scheduling_variable_moves_the_joint():
    trial = simulate(
        seed=2,
        duration=30.0,
        variation="schedule",
        movement=0.4,
        stiffness_variation=0.3,
        amplitude=1e-6,
    )
    schedule = trial["schedule"].values
    assert schedule.min() >= 0.0
    assert schedule.max() <= 1.0
    assert np.corrcoef(schedule, trial["reference"].values)[0, 1] > 0.999
    expected = 150.0 * (1 + 0.3 * np.cos(2 * np.pi * (schedule - 0.5)))
    np.testing.assert_allclose(trial["stiffness_true"], expected)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"stiffness_variation": 0.3},
            "stiffness_table and stiffness_variation need `variation`: cycle, time or schedule",
        ),
        ({"gain_table": [1.0, 2.0]}, "gain_table and gain_variation need `variation`"),
        (
            {"variation": "cycle", "gain_table": [1.0, -2.0]},
            "gain_table must hold values of at least 0, got -2",
        ),
        (
            {"variation": "cycle", "viscosity_table": [1.0]},
            r"viscosity_table must be 2 numbers .*, got \[1.0\]",
        ),
        (
            {"variation": "cycle", "viscosity_table": "1; 2"},
            "viscosity_table must be 2 numbers .*, got '1; 2'",
        ),
        (
            {"variation": "cycle", "viscosity_table": [1.0, float("nan")]},
            "viscosity_table must be a finite number",
        ),
    ],
)
def test_settings_that_contradict_each_other(settings, message):
    with pytest.raises(ValueError, match=message) as caught:
        simulate(seed=1, **settings)
    assert not isinstance(caught.value, DataError)
