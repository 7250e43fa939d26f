"""Options of methods and settings of the simulation."""

from functools import partial

from ankleloop import (
    DataError,
    UnstableLoopError,
    identify,
    simulate,
)
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import good_trial


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
        wrong(
            "unknown option of a method",
            "method 'riv' has no option 'blok_rows'; it has identification_rate",
            method="riv",
            blok_rows=3,
            error=TypeError,
        ),
        wrong(
            "an order as large as the block rows",
            "block_rows must be larger than the order",
            method="pr-moesp",
            order=10,
            block_rows=10,
        ),
        wrong(
            "a rate that does not divide that of the record",
            "not a whole multiple of the identification rate (70 Hz)",
            "choose",
            identification_rate=70.0,
            error=DataError,
        ),
        wrong(
            "a reference that the trial does not have",
            "the trial has no variable 'command'",
            "Give the command of the servo",
            reference="command",
            error=DataError,
        ),
    ]


def _rows_of_simulations() -> list[BadInput]:
    row = partial(rows_of(simulate_with), error=ValueError)
    return [
        row(
            "no seed",
            settings(seed=None),
            "seed must be a whole number of at least 0 or a numpy.random.SeedSequence, got None",
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
