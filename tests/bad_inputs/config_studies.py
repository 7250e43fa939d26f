"""Simulated studies of the configuration, their settings and methods."""

from bad_inputs.bad_input import BadInput
from bad_inputs.config_inputs import method, row, study


def _rows_of_studies() -> list[BadInput]:
    place = "config → studies → s"
    return [
        row("unknown key of a study", study(trails=3), f"{place}: unknown key 'trails'", "did you mean 'trials'"),
        row("2.5 trials", study(trials=2.5), f"{place} → trials", "whole number", "got 2.5"),
        row("a figure behind the end of the trial", study(figure={"start": 100.0}), place, "figure", "start", "100"),
    ]


def _rows_of_simulations() -> list[BadInput]:
    place = "config → studies → s"
    return [
        row(
            "unknown setting",
            study(simulation={"stifness": 1.0}),
            f"{place} → simulation: unknown key 'stifness'",
            "did you mean 'stiffness'",
        ),
        row(
            "a point twice",
            study(points={"reflex_gain": [13, 13.0]}),
            f"{place} → points: the point reflex_gain=13.0 is listed twice",
        ),
        row(
            "no list of values",
            study(points={"zeta": 1.0}),
            f"{place} → points → zeta: must be a list of values",
            "got 1.0",
        ),
        row(
            "10,000,000,000 points",
            study(points={name: list(range(1, 101)) for name in ("zeta", "delay", "stiffness", "inertia", "omega_n")}),
            f"{place} → points: 10,000,000,000 points are more than 100,000",
        ),
    ]


def _rows_of_methods() -> list[BadInput]:
    place = "config → studies → s → methods"
    return [
        row(
            "unknown option",
            method(options={"blok_rows": 3}),
            f"{place} → a → options: unknown key 'blok_rows'",
            "did you mean 'block_rows'",
        ),
        row(
            "an order as large as the block rows",
            method(options={"order": 15}),
            f"{place} → a → options",
            "block_rows must be larger than the order",
        ),
        row(
            "a rate that does not divide that of the record",
            method(options={"identification_rate": 70.0}),
            f"{place} → a",
            "70",
            "1000",
        ),
        row(
            "an option that is fixed and selected",
            method(options={"order": 2}, select={"order": [2, 3]}),
            f"{place} → a: option 'order' is given, and to be selected as well",
        ),
    ]


ROWS = [*_rows_of_studies(), *_rows_of_simulations(), *_rows_of_methods()]
