"""Which methods are valid for a recording, and with which options; the methods that it is tried with first."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ankleloop.methods.method import UNKNOWN, Method, Offer
from ankleloop.methods.registry import JOINT_METHODS, find_method

# % of K; the scatter of this measure in a record of a minute is about half of it.
LARGEST_PATH_BIAS = 10.0

Options = Mapping[str, Any]  # of a method, by name
Methods = dict[str, dict[str, Any]]  # with their options, or what a study has of them


def valid_methods(loop: str, reference: bool, path_bias: float, *, merged: bool = False) -> Methods:
    """Methods of the library that are valid for a recording, with the options that make them so."""
    methods: Methods = {}
    for name, method in JOINT_METHODS.items():
        options = _valid_options(method, reference) if loop != "open" or not reference else {}
        if reason_against(name, options, loop, reference, path_bias, merged=merged) is None:
            methods[name] = options
    return methods


def _valid_options(method: Method, reference: bool) -> dict[str, Any]:
    """Options that make a method valid in any loop with a reference, and in open loop without one."""
    validity = method.validity
    return dict((validity.closed or {}) if reference else validity.without_reference)


def describe_validity(
    methods: Methods, loop: str, reference: bool, path_bias: float, *, merged: bool = False
) -> str:
    """Which methods are valid for a recording, and which are not, in sentences."""
    invalid = [
        name
        for name, method in JOINT_METHODS.items()
        if name not in methods and (method.merges or not merged)
    ]
    changed = {name: options for name, options in methods.items() if options}
    parts = [", ".join(name for name in methods if name not in changed)]
    if changed:
        options = next(iter(changed.values()))
        needed = _format_options(options) if reference else "the position as reference"
        parts.append(f"with {needed} {', '.join(changed)}")
    if invalid:
        parts.append(f"not {', '.join(invalid)}")
    is_open = loop == "open"
    if not is_open and not reference:
        parts.append("none of them if the loop was closed")
    sentence = "; ".join(filter(None, parts))
    text = f"of those that merge trials, {sentence}." if merged else f"{sentence}."
    if (is_open or not reference) and abs(path_bias) > LARGEST_PATH_BIAS and not merged:
        where = "in one pass (real-time, parallel-cascade with max_passes=1)"
        text += f" Intrinsic and reflex path are correlated here: {where} K would be off by {path_bias:+.0f} %."
    return text


def reason_against(
    method: str | Method,
    options: Options,
    loop: str,
    reference: bool,
    path_bias: float,
    *,
    merged: bool = False,
) -> str | None:
    """Why a method with its options is not valid for a recording; None if it is."""
    entry = find_method(method)
    used = entry.reference(entry.options.model_construct(**options))  # they have been checked
    if merged and not entry.merges:
        return "it identifies one trial at a time, and does not merge them"
    if loop != "open" and reference:
        return _reason_in_closed_loop(entry, options, loop, used)
    one_pass = entry.validity.one_pass
    is_one_pass = one_pass is not None and one_pass.items() <= options.items()
    if is_one_pass and abs(path_bias) > LARGEST_PATH_BIAS:
        fault = "it estimates intrinsic and reflex path one after the other, once, and they are correlated here"
        return f"{fault}: K would be off by {path_bias:+.0f} %. It needs a perturbation that decorrelates them (pulses)"
    if not reference and used not in (None, "position"):
        return "needs a reference: with reference='position' it is valid if the loop is open"
    return None


def _reason_in_closed_loop(
    method: Method, options: Options, loop: str, reference: str | None
) -> str | None:
    """Why a method that uses a reference, or none, is not valid unless the loop is open."""
    validity = method.validity
    if validity.closed is None:
        known = "known to be valid" if validity is UNKNOWN else "valid"
        return f"it is not {known} in closed loop, and the loop is {loop}"
    if reference == "position":
        return f"the position is a reference in open loop only, and the loop is {loop}"
    if not validity.closed.items() <= options.items():
        needed = _format_options(validity.closed)
        return f"{validity.closed_fault}, and the loop is {loop}: {needed}"
    return None


def _format_options(options: Options) -> str:
    """Options as arguments of a call."""
    return ", ".join(f"{name}={value!r}" for name, value in options.items())


def usual_methods(
    *, reference: bool, changing: bool = False, names: Collection[str] = ()
) -> Methods:
    """Methods with labels and options that suit a minute of a recording at the ankle.

    Those of some names, registered ones among them; else all of the library for joints that are offered, those for a
    joint that changes only if it does.
    """
    named = {name: find_method(name) for name in names}
    methods = {}
    for name, method in {**JOINT_METHODS, **named}.items():
        offer = method.offer
        if offer is None:
            continue
        is_meant = name in names if names else changing or not offer.changing
        if is_meant:
            methods[name] = _describe_offer(method, offer, reference)
    return methods


def _describe_offer(method: Method, offer: Offer, reference: bool) -> dict[str, Any]:
    """A method with its label, its options and those to be selected, as a study has them."""
    options = {**_valid_options(method, reference), **offer.options}
    candidates: Options = {}
    if not reference:
        options |= offer.options_without_reference
        candidates = offer.candidates_without_reference
    label = offer.label
    if options.get("reference") == "position":
        label += ", position as reference"
    return {
        "method": method.name,
        "label": label,
        "options": {name: value for name, value in options.items() if name not in candidates},
        "select": {name: list(values) for name, values in candidates.items()},
    }
