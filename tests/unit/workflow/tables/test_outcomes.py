import pandas as pd

from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.tables.outcomes import list_reasons, true_values


def test_true_values_are_those_of_the_simulation():
    values = true_values(SimulationSettings(stiffness=90.0).model_dump(), ["B", "K"])
    assert list(values.items()) == [("B", 0.8), ("K", 90.0)]


def test_reasons_that_differ_in_numbers_alone_are_one():
    table = pd.DataFrame(
        {
            "point": ["a", "a", "b", "b"],
            "method": "riv",
            "failure": [None, "no pole", None, None],
            "warnings": ["B = -0.1 is negative", None, "B = -2e-05 is negative", None],
        }
    )
    columns = ["outcome", "point", "reason", "identifications"]
    assert list_reasons(table)[columns].values.tolist() == [
        ["warning", "a", "B = -0.1 is negative", 2],
        ["failure", "a", "no pole", 1],
    ]
