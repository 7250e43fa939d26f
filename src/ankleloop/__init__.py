"""Closed-loop identification of intrinsic and reflex joint stiffness.

Separates the torque of a joint into intrinsic and reflex parts from data recorded while the joint pushes against a
compliant load. Start with `simulate` or `read_trial`, then `identify` and `evaluate`.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# Module of each public name, imported at the first use of the name (PEP 562), so that a job loads only what it needs.
_MODULES = {
    "METHODS": "methods.registry",
    "DataError": "errors",
    "Estimate": "joint.estimate",
    "LiveEstimate": "live.live_estimate",
    "UnstableLoopError": "errors",
    "block_bootstrap": "assessment.bootstrap",
    "check_trial": "recordings.checks",
    "compare": "recordings.comparison",
    "cramer_rao": "assessment.cramer_rao",
    "design_perturbation": "experiments.perturbation",
    "evaluate": "assessment.scores",
    "identify": "methods.registry",
    "identify_each": "recordings.many",
    "load_estimate": "joint.estimate_files",
    "load_trial": "trials.trial_files",
    "method_options": "methods.registry",
    "new_trial": "trials.trial",
    "plan_duration": "experiments.duration",
    "read_trial": "trials.readers",
    "save_estimate": "joint.estimate_files",
    "save_trial": "trials.trial_files",
    "segment": "trials.trial",
    "simulate": "simulation.simulate",
    "trajectory_bound": "assessment.cramer_rao",
    "vaf": "signals.vaf",
}

__all__ = [*_MODULES, "subspace"]


def __getattr__(name: str) -> Any:
    if name == "subspace":
        return import_module("ankleloop.subspace")
    if name not in _MODULES:
        raise AttributeError(f"module 'ankleloop' has no attribute {name!r}")
    value = getattr(import_module(f"ankleloop.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
