"""Which method is valid in which loop, and with which options; the methods that a recording is tried with first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ankleloop.methods.registry import METHODS

LARGEST_PATH_BIAS = 10.0  # % of K; the scatter of this measure in a record of a minute is about half of it

DEGREE = 8  # of the basis of usual methods
INSTRUMENTS = {"input_matrices": "instruments"}
SUBSPACE_POLES = (
    "in closed loop its B and D are estimated by instruments, but its poles by a subspace step that is not consistent "
    "there: compare K with that of riv (the study voluntary measures its error)."
)
WHITE_NOISE = "it assumes white noise: voluntary torque biases its poles, and with them K, B and I."


@dataclass(frozen=True)
class Validity:
    """Where a method is valid. In open loop with a reference every method is, if its paths need not be uncorrelated."""

    closed: Mapping[str, Any] | None  # options that make it valid in closed loop; None where nothing does
    without_reference: Mapping[str, Any]  # options that make it valid in open loop if the record has no reference
    closed_caution: str = ""  # what to bear in mind where it is valid in closed loop
    open_caution: str = ""  # what to bear in mind where it is valid in open loop
    # Options with which it estimates the two paths one after the other, once, and is biased where they are correlated.
    one_pass: Mapping[str, Any] | None = None


# In the order in which methods are preferred where the data cannot tell them apart: the fewest parameters first.
VALIDITY: Mapping[str, Validity] = {
    "riv": Validity({}, {"reference": "position"}),
    "pr-moesp": Validity(INSTRUMENTS, {"reference": "position"}, SUBSPACE_POLES),
    "pi-moesp": Validity(INSTRUMENTS, {}, SUBSPACE_POLES),
    "po-moesp": Validity(INSTRUMENTS, {}, SUBSPACE_POLES),
    "eiv-moesp": Validity(INSTRUMENTS, {}, SUBSPACE_POLES, WHITE_NOISE),
    "moesp": Validity(None, {}, "", WHITE_NOISE),
    "parallel-cascade": Validity(None, {}, one_pass={"max_passes": 1}),
    "real-time": Validity(None, {}, one_pass={}),
    "riv-tv": Validity({}, {"reference": "position"}),
}


def valid_methods(loop: str, reference: bool, path_bias: float, *, merged: bool = False) -> dict[str, dict[str, Any]]:
    """Methods that are valid for a recording, with the options that make them so."""
    methods: dict[str, dict[str, Any]] = {}
    for name, validity in VALIDITY.items():
        options = validity.without_reference if not reference else {} if loop == "open" else validity.closed
        if options is None or (merged and not METHODS[name].merges) or _is_biased(validity, options, path_bias):
            continue
        methods[name] = dict(options)
    return methods


def describe_validity(loop: str, reference: bool, path_bias: float, *, merged: bool = False) -> str:
    """Which methods are valid for a recording, in sentences."""
    methods = valid_methods(loop, reference, path_bias, merged=merged)
    merging = [name for name in VALIDITY if METHODS[name].merges or not merged]
    invalid = [name for name in merging if name not in methods]
    prefix = "of those that merge trials, " if merged else ""
    if loop != "open" and reference:
        return prefix + _describe_closed(loop, methods, invalid)
    if loop == "open":
        text = f"all but {', '.join(invalid)}" if invalid else "all"
    else:
        position = [name for name, options in methods.items() if options]
        rest = [name for name in methods if name not in position]
        text = (
            f"those that need no reference ({', '.join(rest)}), and {', '.join(position)} with the position for one; "
            "none of them if the loop was closed"
        )
    if abs(path_bias) > LARGEST_PATH_BIAS and not merged:
        text += (
            ". Intrinsic and reflex path are correlated here: in one pass (real-time, parallel-cascade with "
            f"max_passes=1) K would be off by {path_bias:+.0f} %"
        )
    return f"{prefix}{text}."


def _describe_closed(loop: str, methods: Mapping[str, Mapping[str, Any]], invalid: Sequence[str]) -> str:
    """Methods that the reference makes valid, and why the others are not."""
    free = ", ".join(name for name, options in methods.items() if not options)
    by_instruments = ", ".join(name for name, options in methods.items() if options)
    text = f"{free}; " if free else ""
    text += (
        f"with {_show(INSTRUMENTS)} {by_instruments}, to be compared with riv, for the instruments do not reach their "
        f"poles. Least squares and {', '.join(invalid)} take torque that is fed back for stiffness."
    )
    return text if loop == "closed" else f"those that are valid in either loop: {text}"


def reason_against(
    method: str, options: Mapping[str, Any], *, loop: str, reference: bool, path_bias: float
) -> str | None:
    """Why a method with its options is not valid for a recording; None if it is."""
    validity, position = VALIDITY[method], options.get("reference") == "position"
    if loop != "open" and reference:
        if validity.closed is None:
            return f"it is not valid in closed loop, and the loop is {loop}"
        if position:
            return f"the position is a reference in open loop only, and the loop is {loop}"
        if any(options.get(name) != value for name, value in validity.closed.items()):
            return f"least squares for B and D is biased in closed loop, and the loop is {loop}: {_show(INSTRUMENTS)}"
        return None
    if _is_biased(validity, options, path_bias):
        return (
            "it estimates intrinsic and reflex path one after the other, once, and they are correlated here: K would "
            f"be off by {path_bias:+.0f} %. It needs a perturbation that decorrelates them (pulses)"
        )
    needs_reference = validity.without_reference or options.get("input_matrices") == "instruments"
    if not reference and needs_reference and not position:
        return "needs a reference: with reference='position' it is valid if the loop is open"
    return None


def caution(method: str, loop: str, reference: bool) -> str:
    """What to bear in mind about a method that is valid for a recording; empty if there is nothing."""
    validity = VALIDITY[method]
    return validity.closed_caution if loop != "open" and reference else validity.open_caution


def _is_biased(validity: Validity, options: Mapping[str, Any], path_bias: float) -> bool:
    """Whether a method with some options is biased by the correlation of the two paths."""
    one_pass = validity.one_pass is not None and validity.one_pass.items() <= options.items()
    return one_pass and abs(path_bias) > LARGEST_PATH_BIAS


def _show(options: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in options.items())


def usual_methods(*, reference: bool, changing: bool = False) -> dict[str, dict[str, Any]]:
    """Methods with labels and options that suit a minute of a recording at the ankle.

    The nonlinearity of the reflex path is a spline, which takes a rectifier with or without a threshold. Without a
    reference its degree and the order of riv are selected on data that the fit has not used: there the VAF tells them
    apart. With a reference they are fixed, since a selection by instruments needs more than 20 s.
    """
    position = {} if reference else {"reference": "position"}
    instruments = dict(INSTRUMENTS) if reference else {}
    as_reference = "" if reference else ", position as reference"
    spline: dict[str, Any] = {"basis": "spline", **({"degree": DEGREE} if reference else {})}
    degrees = {} if reference else {"degree": [6, DEGREE, 12]}
    weighting = "noise" if reference else "flat"
    methods: dict[str, dict[str, Any]] = {
        "riv": {
            "label": f"Refined instrumental variables (spline){as_reference}",
            "method": "riv",
            "options": {**position, "weighting": weighting, **spline},
            "select": {} if reference else {**degrees, "order": [2, 3]},
        },
        "pr-moesp": {
            "label": f"PR-MOESP{as_reference}",
            "method": "pr-moesp",
            "options": {**position, **instruments, "degree": DEGREE, "block_rows": 20},
        },
        "pi-moesp": {
            "label": "PI-MOESP (spline)",
            "method": "pi-moesp",
            "options": {**instruments, "block_rows": 20, **spline},
            "select": degrees,
        },
        "parallel-cascade": {"label": "Parallel cascade, to convergence", "method": "parallel-cascade", "options": {}},
    }
    if changing:
        label = f"Joint that changes (riv-tv){as_reference}"
        methods["riv-tv"] = {"label": label, "method": "riv-tv", "options": {**position, "weighting": weighting}}
    return methods
