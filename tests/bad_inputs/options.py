"""Options of methods and settings of the simulation."""

from functools import partial

import numpy as np

from ankleloop import (
    DataError,
    UnstableLoopError,
    identify,
    simulate,
)
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import good_trial

TITLE = "Options and settings"


def settings(**values):
    """Settings of the simulation."""
    return lambda folder: {"duration": 2.0, **values}


def simulate_with(values: dict) -> None:
    """Simulate a trial with these settings."""
    simulate(**{"seed": 1, **values})


def _rows_of_methods() -> list[BadInput]:
    def wrong(text, *says, error=ValueError, **options):
        return BadInput(text, good_trial, partial(identify, **options), says, error=error)

    return [
        wrong(
            "unknown method", "unknown method 'pr-moes' (did you mean 'pr-moesp'?); known: pr-moesp", method="pr-moes"
        ),
        wrong("a method that is a number", "unknown method 3; known: pr-moesp", method=3),
        wrong("a method in a list", "unknown method ['riv']", method=["riv"]),
        wrong(
            "unknown option of a method",
            "method 'riv' has no option 'blok_rows'; it has order",
            method="riv",
            blok_rows=3,
            error=TypeError,
        ),
        wrong(
            "an option of another method",
            "method 'parallel-cascade' has no option 'order'",
            method="parallel-cascade",
            order=2,
            error=TypeError,
        ),
        wrong("an order of 0", "order must be between 1 and 20, got 0", order=0),
        wrong("an order of 2.5", "order must be a whole number between 1 and 20, got 2.5", order=2.5),
        wrong("an order as text", "order must be a whole number between 1 and 20, got '2'", order="2"),
        wrong("an order that is true", "order must be a whole number between 1 and 20, got True", order=True),
        wrong(
            "an order as large as the block rows", "block_rows must be larger than the order", order=10, block_rows=10
        ),
        wrong("an order in an array", "order must be a whole number", order=np.array([2, 3])),
        wrong("order 4 of riv", "order must be one of 2 or 3; got 4", method="riv", order=4),
        wrong("-5 block rows", "block_rows must be between 3 and 200 samples, got -5", block_rows=-5),
        wrong(
            "block rows that no record fills",
            "shorter than its Hankel window",
            "Record longer",
            "block_rows",
            order=2,
            block_rows=200,
            instrument_rows=1000,
            error=DataError,
        ),
        wrong("a negative delay", "delay must be between 0 and 1 s, got -0.01", delay=-0.01),
        wrong("a delay in ms", "delay must be between 0 and 1 s, got 40", delay=40),
        wrong(
            "a delay that is nan",
            "delay must be a finite number between 0 and 1 s, got nan",
            method="riv",
            delay=float("nan"),
        ),
        wrong("a delay in a list", "delay must be a finite number between 0 and 1 s, got [0.04]", delay=[0.04]),
        wrong("unknown basis", "basis must be one of 'chebyshev', 'rectifier' or 'spline'; got 'relu'", basis="relu"),
        wrong("a basis of degree 0", "degree must be between 1 and 30, got 0", degree=0),
        wrong("a basis of degree 31", "degree must be between 1 and 30, got 31", degree=31),
        wrong(
            "a rate that does not divide that of the record",
            "not a whole multiple of the identification rate (70 Hz)",
            "choose",
            identification_rate=70.0,
            error=DataError,
        ),
        wrong(
            "an infinite rate",
            "identification_rate must be a finite number between 1 and 10000 Hz, got inf",
            identification_rate=np.inf,
        ),
        wrong(
            "a rate above that of the record",
            "not a whole multiple of the identification rate (4000 Hz)",
            identification_rate=4000.0,
            error=DataError,
        ),
        wrong(
            "a reference that the trial does not have",
            "the trial has no variable 'command'",
            "Give the command of the servo",
            reference="command",
            error=DataError,
        ),
        wrong(
            "a tolerance of the rank of 1", "rank_tolerance must be at least 0 and below 1, got 1.0", rank_tolerance=1.0
        ),
        wrong("no passes", "max_passes must be between 1 and 10000, got 0", method="parallel-cascade", max_passes=0),
        wrong("no iterations", "max_iterations must be between 1 and 10000, got 0", method="riv", max_iterations=0),
        wrong(
            "forgetting faster than a sample",
            "memory must be between 0.1 and 1e6 s, got 0.0",
            method="real-time",
            memory=0.0,
        ),
        wrong(
            "nothing to select from",
            "select must have a list with at least one value of each option",
            "got [] for 'order'",
            select={"order": []},
        ),
        wrong(
            "an option set and selected",
            "option 'order' is given, and to be selected as well",
            order=2,
            select={"order": [1]},
            error=TypeError,
        ),
        wrong("candidates that are no list", "select must have a list", "got 2 for 'order'", select={"order": 2}),
        wrong("a candidate out of range", "order must be between 1 and 20, got 0", select={"order": [0, 2]}),
        wrong(
            "unknown criterion",
            "criterion must be one of 'instrumental', 'cross-validation' or None",
            "got 'aic'",
            select={"order": [1, 2]},
            criterion="aic",
        ),
        wrong("a criterion of nothing", "criterion is that of a selection", "select", criterion="instrumental"),
    ]


def _rows_of_simulations() -> list[BadInput]:
    row = partial(rows_of(simulate_with), error=ValueError, shown="simulate")
    return [
        row(
            "unknown setting",
            settings(stifness=150.0),
            "simulate has no option 'stifness' (did you mean 'stiffness'?)",
            error=TypeError,
        ),
        row(
            "no seed",
            settings(seed=None),
            "seed must be a whole number of at least 0 or a numpy.random.SeedSequence, got None",
        ),
        row("a seed below 0", settings(seed=-1), "seed must be a whole number of at least 0", "got -1"),
        row("a seed that is not whole", settings(seed=1.5), "seed must be a whole number", "got 1.5"),
        row("a seed as text", settings(seed="1"), "seed must be a whole number", "got '1'"),
        row("negative stiffness", settings(stiffness=-1.0), "stiffness must be between 0 and 1e6 N·m/rad, got -1.0"),
        row(
            "an inertia that is nan",
            settings(inertia=float("nan")),
            "inertia must be a finite number between 0 and 10000 kg·m², got nan",
        ),
        row("a damping ratio of 0", settings(zeta=0.0), "zeta must be between 0.001 and 1000, got 0.0"),
        row("a duration of 0 s", settings(duration=0.0), "duration must be above 0 and at most 1e6 s, got 0.0"),
        row(
            "a duration as text",
            settings(duration="50"),
            "duration must be a finite number above 0 and at most 1e6 s, got '50'",
        ),
        row(
            "a duration between two samples",
            settings(duration=2.0005),
            "duration × recording_rate must be a whole number, got 2000.5",
        ),
        row(
            "a duration that no memory holds",
            settings(duration=1e12),
            "duration must be above 0 and at most 1e6 s, got 1000000000000.0",
        ),
        row(
            "a delay below one sample",
            settings(delay=0.0001),
            "delay must be at least one recorded sample (0.001 s), got 0.0001 s",
        ),
        row(
            "a load without inertia",
            settings(load_inertia=0.0),
            "load_inertia must be between 1e-6 and 1e6 kg·m², got 0.0",
        ),
        row(
            "a load of two numbers",
            settings(load=(1.0, 2.0)),
            "load must be three numbers (inertia, viscosity, stiffness), got (1.0, 2.0)",
        ),
        row(
            "voluntary torque above the Nyquist frequency",
            settings(voluntary_cutoff=500.0),
            "voluntary_cutoff must be below half of the recording_rate (500 Hz)",
        ),
        row(
            "an unknown perturbation",
            settings(perturbation="sine"),
            "perturbation must be one of 'prbs' or 'pulses'; got 'sine'",
        ),
        row(
            "an amplitude of 1e160 rad",
            settings(amplitude=1e160),
            "amplitude must be between 1e-9 and 1000 rad, got 1e+160",
        ),
        row(
            "an amplitude of 1e-160 rad",
            settings(amplitude=1e-160),
            "amplitude must be between 1e-9 and 1000 rad, got 1e-160",
        ),
        row(
            "a frequency of 1e300 rad/s",
            settings(omega_n=1e300),
            "omega_n must be between 0.01 and 100000 rad/s, got 1e+300",
        ),
        row(
            "an unstable loop",
            settings(load=(0.1, 5.0, 100.0), reflex_gain=30.0, duration=10.0),
            "the closed loop is unstable: the position passes ±1 rad",
            "Take a heavier or more damped load",
            error=UnstableLoopError,
        ),
    ]


ROWS = [*_rows_of_methods(), *_rows_of_simulations()]
