"""The registry: every identification method under its name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from ankleloop.errors import DataError
from ankleloop.joint.prepared import prepare
from ankleloop.methods import moesp, parallel_cascade, real_time
from ankleloop.methods.method import Method, Trial
from ankleloop.methods.riv import riv
from ankleloop.methods.riv_tv import riv_tv
from ankleloop.methods.selection import check_selection, select_options
from ankleloop.options import suggest_name

FAMILIES = (moesp, parallel_cascade, real_time, riv, riv_tv)
DEFAULT = "riv"  # where there is a reference; without one no method is valid whatever the loop
NO_DEFAULT = (
    "the trial has no reference, so no method is valid whatever the loop: give the command of the servo as reference, "
    "or, if nothing was compliant while it was recorded (open loop), name a method: 'riv' or 'pr-moesp' with "
    "reference='position', 'pi-moesp', 'po-moesp', 'eiv-moesp', 'moesp', 'parallel-cascade' or 'real-time'."
)
METHODS: Mapping[str, Method] = {
    method.name: method for module in FAMILIES for method in module.METHODS
}


def find_method(name: str) -> Method:
    """The method of a name."""
    if not isinstance(name, str) or name not in METHODS:
        raise ValueError(
            f"unknown method {name!r}{suggest_name(name, METHODS)}; known: {', '.join(METHODS)}."
        )
    return METHODS[name]


def method_options(method: str) -> dict[str, Any]:
    """Options of a method with their defaults.

    >>> method_options("parallel-cascade")["tolerance"]
    0.001
    """
    return find_method(method).options.defaults()


def identify(
    trial: Trial | Sequence[Trial],
    method: str | None = None,
    *,
    select: Mapping[str, Sequence[Any]] | None = None,
    criterion: str | None = None,
    **options: Any,
) -> Any:
    """Separate the torque of a joint into its intrinsic and reflex parts.

    Parameters
    ----------
    trial : xarray.Dataset, or list of those
        A trial from `new_trial`, `read_trial` or `simulate`. The MOESP family merges several short ones into one
        identification. A trial that several methods take can be prepared once by `ankleloop.joint.prepared.prepare`.
    method : str, optional
        By default "riv", which torque that is fed back does not bias, where the trial has a `reference`. One of
        `METHODS`: "pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp", "moesp" (see
        `ankleloop.methods.moesp.identify_moesp`), "parallel-cascade" (see
        `ankleloop.methods.parallel_cascade.identify_parallel_cascade`), "real-time" (see
        `ankleloop.methods.real_time.identify_real_time`), "riv" (see `ankleloop.methods.riv.riv.identify_riv`) or
        "riv-tv" (see `ankleloop.methods.riv_tv.riv_tv.identify_riv_tv`).
    select : dict of str to sequence, optional
        Options to choose from, each with its candidates from simple to complex. The choice is made on parts of the
        record that the fit has not seen (see `ankleloop.methods.selection.select_options`), then the whole record is
        fitted; the choice and its curve are in `diagnostics["selection"]`.
    criterion : {"instrumental", "cross-validation"}, optional
        Criterion of the choice; "instrumental" where there is a reference.
    **options
        Options of the method, see `method_options` and the documentation of its options,
        ``help(ankleloop.METHODS["riv"].options)``.

    Returns
    -------
    Estimate
        Torques, model, K, B, I, reflex parameters and diagnostics; a list of them, with one model, for merged trials.

    Raises
    ------
    ValueError, TypeError
        For an unknown method or option, or one outside its range.
    DataError
        For a trial that the method cannot use, or that says nothing, such as one whose reference explains nothing of
        the position; and for a list that has a record twice. Faults that leave an estimate are in
        ``diagnostics["warnings"]`` (`ankleloop.checks.data.check_data`).

    Examples
    --------
    >>> from ankleloop.simulation.simulate import simulate
    >>> estimate = identify(simulate(seed=1, duration=20.0), "pr-moesp", basis="rectifier")
    >>> sorted(estimate.stiffness)
    ['B', 'I', 'K']
    """
    if method is None and isinstance(trial, (list, tuple)):
        raise DataError(
            "name the method for trials that are merged: one of the MOESP family, such as pr-moesp."
        )
    if method is None and "reference" not in prepare(cast(Trial, trial)).trial:
        raise DataError(NO_DEFAULT)
    entry = find_method(DEFAULT if method is None else method)
    if select is None and criterion is None:
        return entry(trial, **options)
    candidates = check_selection(
        f"method {entry.name!r}", entry.options, options, select, criterion
    )
    if isinstance(trial, (list, tuple)):
        raise DataError(
            "options are selected on one trial at a time: set them for trials that are merged."
        )
    selection = select_options(
        cast(Trial, trial), entry, candidates, criterion=criterion, **options
    )
    estimate = entry(trial, **options, **selection["chosen"])
    estimate.diagnostics["selection"] = selection
    return estimate
