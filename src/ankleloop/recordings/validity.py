"""Which method is valid in which loop, and with which options; the methods that a recording is tried with first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ankleloop.methods.registry import METHODS

LARGEST_PATH_BIAS = (
    10.0  # % of K; the scatter of this measure in a record of a minute is about half of it
)

DEGREE = 8  # of the basis of usual methods
INSTRUMENTS, POSITION = {"input_matrices": "instruments"}, {"reference": "position"}
INSTRUMENTS_TEXT = "input_matrices='instruments'"
SUBSPACE_POLES = "in closed loop its B and D are estimated by instruments, but its poles by a subspace step that is "
SUBSPACE_POLES += (
    "not consistent there: compare K with that of riv (the study voluntary measures its error)."
)
WHITE_NOISE = "it assumes white noise: voluntary torque biases its poles, and with them K, B and I."


class Validity(NamedTuple):
    """Where a method is valid. In open loop with a reference every method is, if its paths need not be uncorrelated."""

    closed: (
        Mapping[str, Any] | None
    )  # options that make it valid in closed loop; None where nothing does
    without_reference: Mapping[
        str, Any
    ]  # options that make it valid in open loop if the record has no reference
    closed_caution: str = ""  # what to bear in mind where it is valid in closed loop
    open_caution: str = ""  # what to bear in mind where it is valid in open loop
    # Options with which it estimates the two paths one after the other, once, and is biased where they are correlated.
    one_pass: Mapping[str, Any] | None = None


# In the order in which methods are preferred where the data cannot tell them apart: the fewest parameters first.
VALIDITY: Mapping[str, Validity] = {
    "riv": Validity({}, POSITION),
    "pr-moesp": Validity(INSTRUMENTS, POSITION, SUBSPACE_POLES),
    "pi-moesp": Validity(INSTRUMENTS, {}, SUBSPACE_POLES),
    "po-moesp": Validity(INSTRUMENTS, {}, SUBSPACE_POLES),
    "eiv-moesp": Validity(INSTRUMENTS, {}, SUBSPACE_POLES, WHITE_NOISE),
    "moesp": Validity(None, {}, "", WHITE_NOISE),
    "parallel-cascade": Validity(None, {}, one_pass={"max_passes": 1}),
    "real-time": Validity(None, {}, one_pass={}),
    "riv-tv": Validity({}, POSITION),
}


def valid_methods(
    loop: str, reference: bool, path_bias: float, *, merged: bool = False
) -> dict[str, dict[str, Any]]:
    """Methods that are valid for a recording, with the options that make them so."""
    methods: dict[str, dict[str, Any]] = {}
    for name, validity in VALIDITY.items():
        options = (
            validity.without_reference
            if not reference
            else {}
            if loop == "open"
            else validity.closed or {}
        )
        if reason_against(name, options, loop, reference, path_bias, merged=merged) is None:
            methods[name] = dict(options)
    return methods


def describe_validity(loop: str, reference: bool, path_bias: float, *, merged: bool = False) -> str:
    """Which methods are valid for a recording, in sentences."""
    methods = valid_methods(loop, reference, path_bias, merged=merged)
    invalid = [
        name for name in VALIDITY if name not in methods and (METHODS[name].merges or not merged)
    ]
    changed = [name for name, options in methods.items() if options]
    parts = [", ".join(name for name in methods if name not in changed)]
    if changed:
        parts.append(
            f"with {INSTRUMENTS_TEXT if reference else 'the position as reference'} {', '.join(changed)}"
        )
    parts += [f"not {', '.join(invalid)}"] if invalid else []
    parts += ["none of them if the loop was closed"] if loop != "open" and not reference else []
    text = f"{'of those that merge trials, ' if merged else ''}{'; '.join(filter(None, parts))}."
    if not (loop != "open" and reference) and abs(path_bias) > LARGEST_PATH_BIAS and not merged:
        where = "in one pass (real-time, parallel-cascade with max_passes=1)"
        text += f" Intrinsic and reflex path are correlated here: {where} K would be off by {path_bias:+.0f} %."
    return text


def reason_against(
    method: str,
    options: Mapping[str, Any],
    loop: str,
    reference: bool,
    path_bias: float,
    *,
    merged: bool = False,
) -> str | None:
    """Why a method with its options is not valid for a recording; None if it is."""
    validity, position = VALIDITY[method], options.get("reference") == "position"
    if merged and not METHODS[method].merges:
        return "it identifies one trial at a time, and does not merge them"
    if loop != "open" and reference:
        if validity.closed is None:
            return f"it is not valid in closed loop, and the loop is {loop}"
        if position:
            return f"the position is a reference in open loop only, and the loop is {loop}"
        if not validity.closed.items() <= options.items():
            return f"least squares for B and D is biased in closed loop, and the loop is {loop}: {INSTRUMENTS_TEXT}"
        return None
    one_pass = validity.one_pass is not None and validity.one_pass.items() <= options.items()
    if one_pass and abs(path_bias) > LARGEST_PATH_BIAS:
        fault = "it estimates intrinsic and reflex path one after the other, once, and they are correlated here"
        return f"{fault}: K would be off by {path_bias:+.0f} %. It needs a perturbation that decorrelates them (pulses)"
    needs_reference = validity.without_reference or INSTRUMENTS.items() <= options.items()
    if not reference and needs_reference and not position:
        return "needs a reference: with reference='position' it is valid if the loop is open"
    return None


def usual_methods(*, reference: bool, changing: bool = False) -> dict[str, dict[str, Any]]:
    """Methods with labels and options that suit a minute of a recording at the ankle.

    The nonlinearity of the reflex path is a spline, which takes a rectifier with or without a threshold. Without a
    reference its degree and the order of riv are selected on data that the fit has not used: there the VAF tells them
    apart. With a reference they are fixed, since a selection by instruments needs more than 20 s.
    """
    if reference:
        suffix, riv, pr_moesp, pi_moesp = "", {"weighting": "noise"}, INSTRUMENTS, INSTRUMENTS
        spline, degrees, orders = {"basis": "spline", "degree": DEGREE}, {}, {}
    else:
        suffix, riv, pr_moesp, pi_moesp = (
            ", position as reference",
            {**POSITION, "weighting": "flat"},
            POSITION,
            {},
        )
        spline, degrees, orders = (
            {"basis": "spline"},
            {"degree": [6, DEGREE, 12]},
            {"order": [2, 3]},
        )
    rows: list[tuple[str, str, dict[str, Any], dict[str, Any]]] = [
        (
            "riv",
            f"Refined instrumental variables (spline){suffix}",
            {**riv, **spline},
            {**degrees, **orders},
        ),
        ("pr-moesp", f"PR-MOESP{suffix}", {**pr_moesp, "degree": DEGREE, "block_rows": 20}, {}),
        ("pi-moesp", "PI-MOESP (spline)", {**pi_moesp, "block_rows": 20, **spline}, degrees),
        ("parallel-cascade", "Parallel cascade, to convergence", {}, {}),
    ]
    if changing:
        rows.append(("riv-tv", f"Joint that changes (riv-tv){suffix}", riv, {}))
    keys = ("method", "label", "options", "select")
    return {row[0]: dict(zip(keys, row, strict=True)) for row in rows}
