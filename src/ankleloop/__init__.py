"""Closed-loop identification of intrinsic and reflex joint stiffness.

Separates the torque of a joint into intrinsic and reflex parts from data recorded while the joint pushes against a
compliant load. Start with `simulate` or `read_trial`, then `identify` and `evaluate`.
"""

from ankleloop import subspace
from ankleloop.errors import DataError, UnstableLoopError
from ankleloop.estimate import Estimate
from ankleloop.evaluation import evaluate
from ankleloop.identify import METHODS, identify, method_options
from ankleloop.metrics import vaf
from ankleloop.readers import read_trial
from ankleloop.simulation import simulate
from ankleloop.trial import load_trial, new_trial, save_trial

__version__ = "0.1.0"

__all__ = [
    "METHODS",
    "DataError",
    "Estimate",
    "UnstableLoopError",
    "evaluate",
    "identify",
    "load_trial",
    "method_options",
    "new_trial",
    "read_trial",
    "save_trial",
    "simulate",
    "subspace",
    "vaf",
]
