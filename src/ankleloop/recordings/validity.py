"""Which method is valid in which loop, and with which options: the table that checks and analyses go by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ankleloop.methods.registry import METHODS

LARGEST_PATH_BIAS = 10.0  # % of K; the scatter of this measure in a record of a minute is about half of it

INSTRUMENTS = {"input_matrices": "instruments"}
SUBSPACE_POLES = (
    "in closed loop its B and D are estimated by instruments, but its poles by a subspace step that is not consistent "
    "there: compare K with that of riv (the study voluntary measures its error)."
)
WHITE_NOISE = "it assumes white noise: voluntary torque biases its poles, and with them K, B and I."


def _never(options: Mapping[str, Any]) -> bool:
    return False


@dataclass(frozen=True)
class Validity:
    """Where a method is valid. In open loop with a reference every method is, if its paths need not be uncorrelated."""

    closed: Mapping[str, Any] | None  # options that make it valid in closed loop; None where nothing does
    without_reference: Mapping[str, Any]  # options that make it valid in open loop if the record has no reference
    closed_caution: str = ""  # what to bear in mind where it is valid in closed loop
    open_caution: str = ""  # what to bear in mind where it is valid in open loop
    # Whether the method with some options estimates the two paths one after the other, once: it is biased where they
    # are correlated.
    one_pass: Callable[[Mapping[str, Any]], bool] = _never


# In the order in which methods are preferred where the data cannot tell them apart: the fewest parameters first.
VALIDITY: Mapping[str, Validity] = {
    "riv": Validity({}, {"reference": "position"}),
    "pr-moesp": Validity(INSTRUMENTS, {"reference": "position"}, SUBSPACE_POLES),
    "pi-moesp": Validity(INSTRUMENTS, {}, SUBSPACE_POLES),
    "po-moesp": Validity(INSTRUMENTS, {}, SUBSPACE_POLES),
    "eiv-moesp": Validity(INSTRUMENTS, {}, SUBSPACE_POLES, WHITE_NOISE),
    "moesp": Validity(None, {}, "", WHITE_NOISE),
    "parallel-cascade": Validity(None, {}, one_pass=lambda options: options.get("max_passes") == 1),
    "real-time": Validity(None, {}, one_pass=lambda options: True),
    "riv-tv": Validity({}, {"reference": "position"}),
}


def valid_methods(loop: str, reference: bool, path_bias: float, *, merged: bool = False) -> dict[str, dict[str, Any]]:
    """Methods that are valid for a recording, with the options that make them so."""
    methods: dict[str, dict[str, Any]] = {}
    for name, validity in VALIDITY.items():
        options = validity.without_reference if not reference else {} if loop == "open" else validity.closed
        if options is None or (merged and not METHODS[name].merges):
            continue
        if not (validity.one_pass(options) and _paths_correlated(path_bias)):
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
    if _paths_correlated(path_bias) and not merged:
        text += (
            ". Intrinsic and reflex path are correlated here: in one pass (real-time, parallel-cascade with "
            f"max_passes=1) K would be off by {path_bias:+.0f} %"
        )
    return f"{prefix}{text}."


def _describe_closed(loop: str, methods: Mapping[str, Mapping[str, Any]], invalid: Sequence[str]) -> str:
    """Methods that the reference makes valid, and why the others are not."""
    free = [name for name, options in methods.items() if not options]
    by_instruments = [name for name, options in methods.items() if options]
    text = f"with {_show(INSTRUMENTS)} {', '.join(by_instruments)}, to be compared with riv, for the instruments "
    text = f"{', '.join(free)}; {text}" if free else text
    text += f"do not reach their poles. Least squares and {', '.join(invalid)} take torque that is fed back for "
    text += "stiffness."
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
    if validity.one_pass(options) and _paths_correlated(path_bias):
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


def _paths_correlated(path_bias: float) -> bool:
    return abs(path_bias) > LARGEST_PATH_BIAS


def _show(options: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in options.items())
