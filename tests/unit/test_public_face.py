"""The public names, their arguments, and what importing them loads."""

import inspect

import ankleloop
from ankleloop.simulation.settings import SimulationSettings


def test_settings_are_the_arguments_of_simulate():
    parameters = inspect.signature(ankleloop.simulate).parameters
    assert {p.kind for p in parameters.values()} == {inspect.Parameter.KEYWORD_ONLY}
    assert set(parameters) >= {"seed", "load", *SimulationSettings.model_fields}
