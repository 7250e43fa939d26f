"""The registry: every identification method under its name, with one signature."""

import inspect
from dataclasses import replace
from functools import lru_cache, partial
from types import MappingProxyType

from ankleloop.errors import DataError
from ankleloop.methods.moesp import MEMBERS, identify_moesp
from ankleloop.methods.parallel_cascade import identify_parallel_cascade
from ankleloop.methods.real_time import identify_real_time
from ankleloop.methods.riv import identify_riv
from ankleloop.methods.selection import select_options

__all__ = ["METHODS", "identify", "method_options"]

METHODS = MappingProxyType(
    {
        **{name: partial(identify_moesp, method=name) for name in MEMBERS},
        "parallel-cascade": identify_parallel_cascade,
        "real-time": identify_real_time,
        "riv": identify_riv,
    }
)


def method_options(method):
    """Options of a method with their defaults.

    Parameters
    ----------
    method : str
        One of `METHODS`.

    Returns
    -------
    dict

    Raises
    ------
    ValueError
        For an unknown method.

    Examples
    --------
    >>> method_options("parallel-cascade")["tolerance"]
    0.001
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}; known: {', '.join(METHODS)}.")
    return dict(_defaults(METHODS[method]))


@lru_cache
def _defaults(function):
    bound = getattr(function, "keywords", {})
    return {
        name: parameter.default
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind is parameter.KEYWORD_ONLY and name not in bound
    }


def identify(trial, method="pr-moesp", *, select=None, criterion=None, **options):
    """Separate the torque of a joint into its intrinsic and reflex parts.

    Parameters
    ----------
    trial : xarray.Dataset, or list of those
        A trial from `new_trial`, `read_trial` or `simulate`. The MOESP family merges several short ones into one
        identification.
    method : str
        One of `METHODS`: "pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp", "moesp" (see
        `ankleloop.methods.moesp.identify_moesp`), "parallel-cascade" (see
        `ankleloop.methods.parallel_cascade.identify_parallel_cascade`), "real-time" (see
        `ankleloop.methods.real_time.identify_real_time`) or "riv" (see `ankleloop.methods.riv.identify_riv`).
    select : dict of str to sequence, optional
        Options to choose from, each with its candidates from simple to complex. The choice is made on parts of the
        record that the fit has not seen (see `ankleloop.methods.selection.select_options`), then the whole record is
        fitted; the choice and its curve are in `diagnostics["selection"]`.
    criterion : {"instrumental", "cross-validation"}, optional
        What the choice goes by; "instrumental" where there is a reference.
    **options
        Options of the method, see `method_options`.

    Returns
    -------
    Estimate
        Torques, model, K, B, I, reflex parameters and diagnostics; a list of them, with one model, for merged trials.

    Raises
    ------
    ValueError
        For an unknown method, or an option outside its range.
    TypeError
        For an option that the method does not have.
    DataError
        For a trial that the method cannot use.

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> estimate = identify(simulate(seed=1, duration=20.0), "pr-moesp", basis="rectifier")
    >>> sorted(estimate.stiffness)
    ['B', 'I', 'K']
    """
    known = method_options(method)
    select = dict(select or {})
    unknown = sorted((set(options) | set(select)) - set(known))
    if unknown:
        raise TypeError(f"method {method!r} has no option {unknown[0]!r}; it has {', '.join(known)}.")
    if isinstance(trial, (list, tuple)) and (method not in MEMBERS or select):
        raise DataError(
            f"{method} {'selects options on' if select else 'identifies'} one trial at a time; trials are merged by "
            f"{', '.join(MEMBERS)}."
        )
    if not select:
        return METHODS[method](trial, **options)
    twice = sorted(set(options) & set(select))
    if twice:
        raise TypeError(f"option {twice[0]!r} is given, and to be selected as well: choose one of the two.")
    given = {**known, **options}
    shared = {name: given[name] for name in ("reference", "delay", "identification_rate") if name in given}
    chosen = select_options(trial, partial(METHODS[method], **options), select, criterion=criterion, **shared)
    estimate = METHODS[method](trial, **options, **chosen.chosen)
    return replace(estimate, diagnostics={**estimate.diagnostics, "selection": chosen.diagnostics})
