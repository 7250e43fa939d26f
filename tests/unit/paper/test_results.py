import numpy as np
import pandas as pd
import pytest

from ankleloop.paper.results import summarise_columns, true_spectral_radius, true_values
from ankleloop.quantities import QUANTITIES
from ankleloop.simulation.settings import SimulationSettings


@pytest.fixture
def parameters():
    """Two points, two methods, two trials; one method has no reflex gain."""
    rows = [
        {
            "point": point,
            "method": method,
            "trial": trial,
            "K": 150.0 + trial,
            "G": np.nan if method == "riv" else 2.0,
        }
        for point in ("gain=5", "gain=10")
        for method in ("riv", "pr-moesp")
        for trial in (0, 1)
    ]
    return pd.DataFrame(rows)


def test_summary_has_the_order_of_the_rows_and_leaves_out_missing_values(parameters):
    summary = summarise_columns(parameters, ["point", "method"], ["K", "G"])
    assert list(summary["point"]) == ["gain=5", "gain=5", "gain=10", "gain=10"]
    assert list(summary.columns[2:5]) == ["K_mean", "K_std", "K_count"]
    assert summary.loc[0, ["K_mean", "K_count", "G_count"]].tolist() == [150.5, 2, 0]
    assert summary.loc[0, "K_std"] == pytest.approx(np.sqrt(0.5))
    assert np.isnan(summary.loc[0, "G_mean"])
    assert summary[["trials", "failures", "warnings"]].values.tolist() == [[2, 0, 0]] * 4


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
