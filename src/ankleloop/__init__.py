"""Closed-loop identification of intrinsic and reflex joint stiffness.

Separates the torque of a joint into intrinsic and reflex parts from data recorded while the joint pushes against a
compliant load. Start with `simulate` or `read_trial`, then `identify` and `evaluate`.

This package holds the algorithms. `ankleloop_lab` is a laboratory's desk (files, recordings, design, live, command
line), whose public names are names of this package, too; `ankleloop_workflow` is what the workflow calls.
"""

from types import ModuleType
from typing import Any

__version__ = "0.1.0"

__all__ = [
    "METHODS",
    "DataError",
    "Estimate",
    "LiveEstimate",
    "UnstableLoopError",
    "block_bootstrap",
    "check_trial",
    "compare",
    "cramer_rao",
    "cut",
    "design_perturbation",
    "evaluate",
    "identify",
    "identify_each",
    "load_estimate",
    "load_trial",
    "method_options",
    "new_trial",
    "plan_duration",
    "read_trial",
    "save_estimate",
    "save_trial",
    "segment",
    "simulate",
    "subspace",
    "subtract",
    "trajectory_bound",
    "vaf",
]


def __getattr__(name: str) -> Any:
    module = _import_module(name)
    value = module if name == "subspace" else getattr(module, name)
    globals()[name] = value
    return value


def _import_module(name: str) -> ModuleType:  # noqa: C901 # a list
    """Module of a public name, imported at the first use of the name (PEP 562): a job loads only what it needs."""
    module: ModuleType
    match name:
        case "DataError" | "UnstableLoopError":
            from ankleloop import errors as module
        case "vaf":
            from ankleloop.signals import vaf as module
        case "new_trial" | "segment":
            from ankleloop.trials import trial as module
        case "cut":
            from ankleloop.trials import windows as module
        case "load_trial" | "save_trial":
            from ankleloop.trials import trial_files as module
        case "simulate":
            from ankleloop.simulation import simulate as module
        case "Estimate":
            from ankleloop.joint import estimate as module
        case "load_estimate" | "save_estimate":
            from ankleloop.joint import estimate_files as module
        case "subtract":
            from ankleloop.methods import apparatus as module
        case "METHODS" | "identify" | "method_options":
            from ankleloop.methods import registry as module
        case "evaluate":
            from ankleloop.assessment import scores as module
        case "block_bootstrap":
            from ankleloop.assessment import bootstrap as module
        case "cramer_rao" | "trajectory_bound":
            from ankleloop.assessment import cramer_rao as module
        case "read_trial":
            from ankleloop_lab.files import reading as module
        case "check_trial":
            from ankleloop_lab.recordings import checks as module
        case "identify_each":
            from ankleloop_lab.recordings import many as module
        case "compare":
            from ankleloop_lab.recordings import comparison as module
        case "design_perturbation":
            from ankleloop_lab.experiments import perturbation as module
        case "plan_duration":
            from ankleloop_lab.experiments import duration as module
        case "LiveEstimate":
            from ankleloop_lab.live import live_estimate as module
        case "subspace":
            import ankleloop.subspace as module
        case _:
            raise AttributeError(f"module 'ankleloop' has no attribute {name!r}")
    return module


def __dir__() -> list[str]:
    return sorted(__all__)
