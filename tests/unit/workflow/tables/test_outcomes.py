import numpy as np
import pandas as pd
import pytest

from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.tables.outcomes import list_reasons, true_spectral_radius, true_values


@pytest.mark.parametrize(
    ("settings", "radius"),
    [
        ({"zeta": 1.0}, np.exp(-0.4)),
        ({"zeta": 0.5}, np.exp(-0.2)),
        ({"zeta": 1.25}, np.exp(-0.2)),  # poles at -20 and -80 rad/s
        ({"zeta": 1.0, "pole": 10.0}, np.exp(-0.1)),
        ({"zeta": 1.0, "pole": 100.0}, np.exp(-0.4)),
    ],
)
def test_spectral_radius_of_the_true_reflex(settings, radius):
    values = SimulationSettings(omega_n=40.0, **settings).model_dump()
    assert true_spectral_radius(values) == pytest.approx(radius, rel=1e-6)


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
