"""The registry: every identification method under its name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, cast

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import prepare_trials
from ankleloop.methods import apparatus, moesp, parallel_cascade, real_time
from ankleloop.methods.ensemble import ensemble
from ankleloop.methods.entry_points import GROUP, find_entry_points, name_package
from ankleloop.methods.method import POSITION, Method, Trial
from ankleloop.methods.riv import riv
from ankleloop.methods.riv_tv import riv_tv
from ankleloop.methods.selection import check_selection, select_options
from ankleloop.options import suggest_name

# In the order in which methods are preferred where the data cannot tell them apart: the fewest parameters first.
FAMILIES = (riv, moesp, parallel_cascade, real_time, riv_tv, apparatus, ensemble)
METHODS: Mapping[str, Method] = {
    method.name: method for module in FAMILIES for method in module.METHODS
}
RECORD_METHODS = {name: method for name, method in METHODS.items() if method.takes_records}
JOINT_METHODS = {name: method for name, method in RECORD_METHODS.items() if not method.of_device}
DEFAULT = "riv"  # where there is a reference; without one no method is valid whatever the loop


def find_method(method: str | Method) -> Method:
    """The method of a name, of the library or registered by another package; a method is found as it is."""
    if isinstance(method, Method):
        return method
    if isinstance(method, str) and method in METHODS:
        return METHODS[method]
    registered, faults = load_registered()
    if isinstance(method, str) and method in registered:
        return registered[method]
    known = {**METHODS, **registered}
    message = f"unknown method {method!r}{suggest_name(method, known)}; known: {', '.join(known)}."
    raise ValueError(" ".join([message, *faults]))


@cache
def load_registered() -> tuple[dict[str, Method], list[str]]:
    """Methods of the entry points of other packages, the first of a name; sentences about those that cannot be used."""
    methods: dict[str, Method] = {}
    faults = []
    for entry_point in find_entry_points():
        try:
            value = entry_point.load()
            loaded = value if isinstance(value, tuple) else (value,)
            for method in loaded:
                if not isinstance(method, Method):
                    raise TypeError(
                        f"an entry point of {GROUP} is a Method or a tuple of them, got {method!r}"
                    )
                methods.setdefault(method.name, method)
        except Exception as error:  # whatever the code of another package raises
            faults.append(
                f"The methods {entry_point.name!r} of the package {name_package(entry_point)} cannot be loaded "
                f"({type(error).__name__}: {error})."
            )
    return methods, faults


def _describe_no_default() -> str:
    """Why there is no default without a reference, and which methods there are if the loop is open."""
    by_position = {
        name
        for name, method in JOINT_METHODS.items()
        if method.validity.without_reference == POSITION
    }
    others = ", ".join(repr(name) for name in JOINT_METHODS if name not in by_position)
    return (
        "the trial has no reference, so no method is valid whatever the loop: give the command of the servo as "
        "reference, or, if nothing was compliant while it was recorded (open loop), take 'riv' with "
        f"reference='position', or one of {others}."
    )


def method_options(method: str | Method) -> dict[str, Any]:
    """Options of a method with their defaults.

    >>> method_options("parallel-cascade")["tolerance"]
    0.001
    """
    return find_method(method).options.defaults()


def identify(
    trial: Trial | Sequence[Trial],
    method: str | Method | None = None,
    *,
    select: Mapping[str, Sequence[Any]] | None = None,
    criterion: str | None = None,
    **options: Any,
) -> Estimate:
    """Separate the torque of a joint into its intrinsic and reflex parts.

    Parameters
    ----------
    trial : xarray.Dataset, or list of those
        A trial from `new_trial`, `read_trial` or `simulate`. The methods riv and riv-tv and the MOESP family merge
        several trials of one condition into one estimate. A trial that several methods take can be prepared once by
        `ankleloop.joint.prepared.prepare`.
    method : str or Method, optional
        By default "riv", which torque that is fed back does not bias, where the trial has a `reference`. One of
        `METHODS`: "pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp", "moesp" (see
        `ankleloop.methods.moesp.identify_moesp`), "parallel-cascade" (see
        `ankleloop.methods.parallel_cascade.identify_parallel_cascade`), "real-time" (see
        `ankleloop.methods.real_time.identify_real_time`), "riv" (see `ankleloop.methods.riv.riv.identify_riv`) or
        "riv-tv" (see `ankleloop.methods.riv_tv.riv_tv.identify_riv_tv`), or of a device without a subject "apparatus"
        (see `ankleloop.methods.apparatus.identify_apparatus`); the name of a method that another package registers by
        an entry point of the group ``ankleloop.methods``; or a `ankleloop.methods.method.Method`.
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
        Torques, model, K, B, I, reflex parameters and diagnostics.

    Raises
    ------
    ValueError, TypeError
        For an unknown method or option, or one outside its range.
    DataError
        For a trial that the method cannot use, or that says nothing, such as one whose reference explains nothing of
        the position; and for a list that has a record twice. Faults that leave an estimate are in
        ``diagnostics["warnings"]`` (`ankleloop.checks.data.check_data`).

    See Also
    --------
    ankleloop.identify_each : Many trials, to a table with a row for each.
    ankleloop.check_trial : What can be identified from a trial, before anything is fitted.
    ankleloop.evaluate : How much of the torque an estimate explains.
    ankleloop.block_bootstrap : Intervals for every method with a model.

    Examples
    --------
    >>> from ankleloop.simulation.simulate import simulate
    >>> estimate = identify(simulate(seed=1, duration=20.0), "pr-moesp", basis="rectifier")
    >>> sorted(estimate.stiffness)
    ['B', 'I', 'K']
    """
    if method is None and any("reference" not in part.trial for part in prepare_trials(trial)):
        raise DataError(_describe_no_default())
    entry = find_method(DEFAULT if method is None else method)
    if select is None and criterion is None:
        return entry(trial, **options)
    owner = f"method {entry.name!r}"
    candidates = check_selection(owner, entry.options, options, select, criterion)
    if isinstance(trial, (list, tuple)):
        raise DataError(
            "options are selected on one trial at a time: set them for trials that are merged."
        )
    selection = select_options(
        cast(Trial, trial), entry, candidates, criterion=criterion, **options
    )
    estimate = entry(trial, **options, **selection["chosen"])
    return replace(estimate, diagnostics={**estimate.diagnostics, "selection": selection})
