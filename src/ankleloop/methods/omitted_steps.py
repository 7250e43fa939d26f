"""Steps of the processing that can be left out, to see what each of them is good for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

__all__ = ["OMITTED_STEPS", "SUBSPACE_OPTIONS", "OmittedStep", "describe_omission"]

OmittedStep = Literal["kernel-derivatives", "early-nonlinearity", "rank-policy", "scaling", "mean-removal"]

# What takes the place of each step.
OMITTED_STEPS: Mapping[OmittedStep, str] = {
    "kernel-derivatives": "velocity and acceleration are central differences, once and twice, of decimated positions",
    "early-nonlinearity": "the basis is applied to the decimated velocity",
    "rank-policy": "all singular values count, however small",
    "scaling": "channels are not scaled to unit variance",
    "mean-removal": "means are not removed, and no offset is estimated",
}

# Options by which `ankleloop.subspace.moesp.moesp` leaves out the steps that are its own.
SUBSPACE_OPTIONS: Mapping[OmittedStep | None, Mapping[str, Any]] = {
    "rank-policy": {"rank_tolerance": 0.0, "regression_tolerance": 0.0},
    "scaling": {"scaling": False},
    "mean-removal": {"offsets": False},
}


def describe_omission(step: OmittedStep) -> str:
    """Warning about an estimate whose processing is not complete."""
    return f"The processing is not complete (omitted_step: {step}): {OMITTED_STEPS[step]}."
