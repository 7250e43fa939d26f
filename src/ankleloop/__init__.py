"""Closed-loop identification of intrinsic and reflex joint stiffness.

Separates the torque of a joint into intrinsic and reflex parts from data recorded while the joint pushes against a
compliant load. Start with `simulate` or `read_trial`, then `identify` and `evaluate`.
"""

from importlib import import_module

__version__ = "0.1.0"

# Where each name lives. It is imported when it is first asked for (PEP 562): a job that needs one module need not wait
# for all of them.
_HOMES = {
    "METHODS": "methods.registry",
    "DataError": "errors",
    "Estimate": "joint.estimate",
    "LongRecord": "methods.long_records",
    "UnstableLoopError": "errors",
    "block_bootstrap": "assessment.bootstrap",
    "cramer_rao": "assessment.cramer_rao",
    "evaluate": "assessment.scores",
    "identify": "methods.registry",
    "identify_file": "methods.long_records",
    "load_trial": "records.trial",
    "method_options": "methods.registry",
    "new_trial": "records.trial",
    "read_trial": "records.readers",
    "save_trial": "records.trial",
    "segment": "records.trial",
    "simulate": "simulation",
    "vaf": "signals.vaf",
}

__all__ = [*_HOMES, "subspace"]


def __getattr__(name):
    if name == "subspace":
        return import_module("ankleloop.subspace")
    if name not in _HOMES:
        raise AttributeError(f"module 'ankleloop' has no attribute {name!r}")
    value = getattr(import_module(f"ankleloop.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *__all__})
