import numpy as np
import pandas as pd
import pytest

from ankleloop.quantities import QUANTITIES
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.tables.outcomes import list_reasons, true_spectral_radius, true_values


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


def test_every_true_value_is_that_of_the_simulation():
    values = true_values(SimulationSettings.defaults())
    assert values == {
        "K": 150.0,
        "B": 0.8,
        "I": 0.015,
        "G": 13.0,
        "omega_n": 40.0,
        "zeta": 1.0,
        "delay": 0.04,
    }
    assert set(values) <= set(QUANTITIES)
    assert list(true_values(SimulationSettings.defaults(), ["B", "K"])) == ["B", "K"]


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
