"""Simulation of a joint that pushes against a compliant load."""

from ankleloop.simulation.settings import (
    Actuator,
    Disturbances,
    Intrinsic,
    Load,
    Perturbation,
    Recorder,
    Reflex,
    Run,
    Simulation,
    parameter_table,
)
from ankleloop.simulation.simulate import simulate, simulate_trials

__all__ = [
    "Actuator",
    "Disturbances",
    "Intrinsic",
    "Load",
    "Perturbation",
    "Recorder",
    "Reflex",
    "Run",
    "Simulation",
    "parameter_table",
    "simulate",
    "simulate_trials",
]
