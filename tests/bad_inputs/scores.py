"""Options of scores, of checks of a trial and of subspace identification."""

from functools import partial

import numpy as np

from ankleloop import (
    block_bootstrap,
    check_trial,
    evaluate,
    subspace,
)
from ankleloop.trials.trial import segment
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import fitted_estimate, good_trial, simulated_trial


def _rows_of_scores() -> list[BadInput]:
    def scored(text, *says, error=ValueError, **options):
        def evaluate_trial(trial):
            evaluate(trial, fitted_estimate(), **options)

        return BadInput(text, good_trial, evaluate_trial, says, error=error)

    return [
        BadInput(
            "the estimate of another trial",
            lambda folder: segment(simulated_trial(), 0.0, 9.0),
            lambda trial: evaluate(trial, fitted_estimate()),
            (
                "the estimate covers 0.38 to 19.69 s, the trial 0 to 8.999 s",
                "score it on the trial that was identified",
            ),
        ),
        BadInput(
            "blocks longer than the record",
            good_trial,
            partial(block_bootstrap, block=50.0),
            ("less than ten blocks of 50 s", "take shorter ones"),
        ),
        BadInput("checks of an empty list", lambda folder: [], check_trial, ("there are no trials to check",)),
    ]


def _rows_of_subspace() -> list[BadInput]:
    u = np.random.default_rng(0).standard_normal((400, 1))
    y = np.cumsum(u, axis=0)

    def signals(**changes):
        return lambda folder: {"u": u, "y": y, "block_rows": 8, "order": 1, **changes}

    row = partial(rows_of(lambda values: subspace.moesp(**values)))
    return [
        row(
            "inputs and outputs of different lengths",
            signals(y=y[:-1]),
            "400 samples of inputs, 399 of the output",
            "cut them to one length",
        ),
        row(
            "instruments of a reference that is missing",
            signals(instruments="past-reference"),
            "past-reference instruments need a reference",
            "pass the external command of the loop",
        ),
    ]


ROWS = [*_rows_of_scores(), *_rows_of_subspace()]
