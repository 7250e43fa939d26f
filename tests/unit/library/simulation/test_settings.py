"""Settings of the simulation: defaults, bounds, grids, and the signature that shows them."""

import sys

import numpy as np
import pytest

from ankleloop import options as arguments
from ankleloop import simulate
from ankleloop.simulation.settings import SimulationSettings


@pytest.mark.parametrize(
    ("settings", "size"),
    [
        ({"duration": 1e6}, "128 GB"),
        ({"duration": 1e6, "recording_rate": 1e5, "integration_rate": 1e6}, "12,800.1 GB"),
        ({"duration": 1.0, "settling": 1e5}, "12.8 GB"),
    ],
)
def test_a_simulation_beyond_the_memory_is_refused_before_it_begins(monkeypatch, settings, size):
    monkeypatch.setattr(arguments, "_find_memory", lambda: 10**9)
    monkeypatch.setattr(
        sys.modules["ankleloop.simulation.simulate"], "run_loop", None
    )  # nothing is computed
    with pytest.raises(
        ValueError,
        match=rf"^simulate: this would need {size} of memory, and the machine has 1 GB: take a",
    ):
        simulate(seed=1, **settings)


def test_the_parameters_of_the_load_may_come_together():
    settings = SimulationSettings.parse(
        "simulate", load=np.array([0.1, 10.0, 100.0]), load_stiffness=300.0
    )
    assert (settings.load_inertia, settings.load_viscosity, settings.load_stiffness) == (
        0.1,
        10.0,
        300.0,
    )


def test_settings_are_attributes_of_a_trial():
    attributes = simulate(seed=3, duration=2.0, snr_db=None, closed_loop=False).attrs
    settings = SimulationSettings(duration=2.0, snr_db=None, closed_loop=False)
    expected = {name: value for name, value in settings if value is not None}
    assert attributes == {"sampling_rate": 1000.0, "seed": 3, **expected}
    assert type(attributes["closed_loop"]) is int  # a file has no booleans
    assert "pole" not in attributes
