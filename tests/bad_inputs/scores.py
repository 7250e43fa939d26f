"""Options of scores, of checks of a trial and of subspace identification."""

from functools import partial

import numpy as np

from ankleloop import (
    DataError,
    block_bootstrap,
    check_trial,
    cramer_rao,
    evaluate,
    method_options,
    subspace,
    trajectory_bound,
)
from ankleloop.records.trial import segment
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import fitted_estimate, good_trial, short_trial, simulated_trial

TITLE = "Options of scores, checks and subspace identification"


def _all_zero(deviations) -> None:
    assert set(deviations.values()) == {0.0}


def _rows_of_scores() -> list[BadInput]:
    def scored(text, *says, error=ValueError, **options):
        def evaluate_trial(trial):
            evaluate(trial, fitted_estimate(), **options)

        return BadInput(text, good_trial, evaluate_trial, says, error=error, shown="evaluate")

    return [
        scored(
            "scored against an unknown torque",
            "against must be one of 'measured' or None",
            "got 'true'",
            against="true",
        ),
        scored("a trim longer than the record", "nothing is left after a trim of 50 s", trim=50.0, error=DataError),
        scored("a negative trim", "trim must be between 0 and 1e6 s, got -1", trim=-1.0),
        scored("a trim that is nan", "trim must be a finite number between 0 and 1e6 s, got nan", trim=float("nan")),
        scored("a trim as text", "trim must be a finite number between 0 and 1e6 s, got '1'", trim="1"),
        BadInput(
            "the estimate of another trial",
            lambda folder: segment(simulated_trial(), 0.0, 9.0),
            lambda trial: evaluate(trial, fitted_estimate()),
            (
                "the estimate covers 0.38 to 19.69 s, the trial 0 to 8.999 s",
                "score it on the trial that was identified",
            ),
            shown="evaluate",
        ),
        BadInput(
            "a number in place of an estimate",
            good_trial,
            lambda trial: evaluate(trial, 90.0),
            ("estimate must be an Estimate", "got 90.0"),
            error=TypeError,
            shown="evaluate",
        ),
        BadInput(
            "options of an unknown method",
            lambda folder: "pr-moes",
            method_options,
            ("unknown method 'pr-moes'",),
            error=ValueError,
        ),
        BadInput(
            "no repetitions",
            good_trial,
            partial(block_bootstrap, repetitions=0),
            ("repetitions must be between 2 and 100000, got 0",),
            error=ValueError,
        ),
        BadInput(
            "blocks of 0 s",
            good_trial,
            partial(block_bootstrap, block=0.0),
            ("block must be between 0.001 and 1e6 s, got 0.0",),
            error=ValueError,
        ),
        BadInput(
            "blocks longer than the record",
            good_trial,
            partial(block_bootstrap, block=50.0),
            ("less than ten blocks of 50 s", "take shorter ones"),
        ),
        BadInput(
            "an unknown option of the bootstrap",
            good_trial,
            partial(block_bootstrap, repetitons=9),
            ("no option 'repetitons'",),
            error=TypeError,
        ),
        BadInput(
            "a bound without a seed",
            lambda folder: {},
            lambda values: cramer_rao(**values),
            ("seed",),
            error=TypeError,
            shown="cramer_rao",
        ),
        BadInput(
            "a bound of an unknown setting",
            lambda folder: {"seed": 1, "gain": 2.0},
            lambda values: cramer_rao(**values),
            ("no option 'gain'",),
            error=TypeError,
            shown="cramer_rao",
        ),
        BadInput(
            "a bound without noise",
            lambda folder: {"seed": 1, "snr_db": None, "voluntary": 0.0, "duration": 5.0},
            lambda values: cramer_rao(**values),
            right=_all_zero,
            shown="cramer_rao",
        ),
        BadInput(
            "a bound of trajectories of a constant joint",
            lambda folder: {"seed": 1, "duration": 20.0},
            lambda values: trajectory_bound(**values),
            ("variation", "cramer_rao"),
            error=ValueError,
            shown="trajectory_bound",
        ),
        BadInput(
            "a bound of trajectories of three cycles",
            lambda folder: {"seed": 1, "duration": 5.0, "variation": "cycle"},
            lambda values: trajectory_bound(**values),
            ("too few whole cycles", "Record more cycles"),
            shown="trajectory_bound",
        ),
        BadInput(
            "a delay as text",
            good_trial,
            partial(check_trial, delay="40 ms"),
            ("delay must be a finite number",),
            error=ValueError,
        ),
        BadInput(
            "an order of -1",
            good_trial,
            partial(check_trial, order=-1),
            ("order must be between 1 and 20, got -1",),
            error=ValueError,
        ),
        BadInput(
            "a rate of 0 Hz",
            good_trial,
            partial(check_trial, identification_rate=0.0),
            ("identification_rate must be",),
            error=ValueError,
        ),
        BadInput("checks of an empty list", lambda folder: [], check_trial, ("there are no trials to check",)),
        BadInput(
            "checks of a trial of 0.6 s",
            lambda folder: short_trial(),
            lambda trial: check_trial(trial).reasons,
            ("record at least 10 s",),
            error=None,
            shown="check_trial",
        ),
    ]


def _rows_of_subspace() -> list[BadInput]:
    u = np.random.default_rng(0).standard_normal((400, 1))
    y = np.cumsum(u, axis=0)

    def signals(**changes):
        return lambda folder: {"u": u, "y": y, "block_rows": 8, "order": 1, **changes}

    row = partial(rows_of(lambda values: subspace.moesp(**values)), shown="subspace.moesp")
    return [
        row(
            "inputs and outputs of different lengths",
            signals(y=y[:-1]),
            "400 samples of inputs, 399 of the output",
            "cut them to one length",
        ),
        row(
            "nan in the input",
            signals(u=np.where(np.arange(400) == 5, np.nan, u[:, 0])),
            "input 0 is not finite at sample 5",
            "cut or repair",
        ),
        row("a constant output", signals(y=np.ones((400, 1))), "output 0 is constant", "leave it out"),
        row(
            "a record that is too short",
            signals(u=u[:20], y=y[:20]),
            "the record of 20 samples is shorter than its Hankel window",
            "Record longer",
        ),
        row("no records", signals(u=[], y=[]), "the record of 0 samples"),
        row("complex inputs", signals(u=u + 1j), "the input must be an array of real numbers"),
        row("inputs as text", signals(u=[["a"]] * 400), "the input must be an array of real numbers"),
        row(
            "block rows no larger than the order",
            signals(order=8),
            "block_rows must be larger than the order (8), got 8",
            error=ValueError,
        ),
        row("unknown instruments", signals(instruments="future"), "instruments must be one of", error=ValueError),
        row(
            "instruments of a reference that is missing",
            signals(instruments="past-reference"),
            "past-reference instruments need a reference",
            "pass the external command of the loop",
        ),
        row(
            "a sampling interval of 0 s",
            signals(dt=0.0),
            "dt must be between 1e-9 and 1e9 s, got 0.0",
            error=ValueError,
        ),
        row("unknown option", signals(rows=3), "no option 'rows'", error=TypeError),
        row("three dimensions", signals(u=np.zeros((4, 10, 10))), "(4, 10, 10)", "(samples, channels)"),
    ]


ROWS = [*_rows_of_scores(), *_rows_of_subspace()]
