"""Options of every method: defaults, bounds, types, documentation."""

import operator
import re
from typing import Literal, get_args, get_origin

import numpy as np
import pytest

import ankleloop
from ankleloop import METHODS, method_options
from ankleloop.methods.moesp import MoespModelOptions, MoespOptions
from ankleloop.methods.parallel_cascade import ParallelCascadeOptions
from ankleloop.methods.real_time import RealTimeOptions
from ankleloop.methods.riv import RivOptions
from ankleloop.methods.riv_tv import RivTvOptions
from ankleloop.options import describe_error

CLASSES = [MoespModelOptions, MoespOptions, ParallelCascadeOptions, RealTimeOptions, RivOptions, RivTvOptions]
FIELDS = [(options, name) for options in CLASSES for name in options.model_fields]
MOESP = {
    "order": 2,
    "block_rows": 15,
    "delay": 0.04,
    "basis": None,
    "degree": 5,
    "identification_rate": 100.0,
    "input_matrices": "least-squares",
    "projection": None,
    "instrument_rows": None,
    "instrument_leads": 0,
    "reference": "reference",
    "free_b": False,
    "omitted_step": None,
    "rank_tolerance": 1e-5,
}
DEFAULTS = {
    **dict.fromkeys(["pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp", "moesp"], MOESP),
    "parallel-cascade": {
        "delay": 0.04,
        "basis": None,
        "identification_rate": 100.0,
        "max_passes": None,
        "tolerance": 1e-3,
        "intrinsic_lags": 0.04,
        "reflex_lags": 0.5,
        "rank": "full",
        "rank_tolerance": 1e-6,
    },
    "real-time": {
        "delay": 0.04,
        "basis": None,
        "identification_rate": 100.0,
        "memory": 10.0,
        "settling": None,
        "reflex_lags": 0.4,
    },
    "riv": {
        "order": 2,
        "delay": 0.04,
        "basis": None,
        "degree": 5,
        "identification_rate": 100.0,
        "reference": "reference",
        "weighting": "noise",
        "intervals": None,
        "max_iterations": 50,
        "tolerance": 0.01,
    },
    "riv-tv": {
        "cycle_onsets": None,
        "schedule": None,
        "knots": (12, 8, 12),
        "inertia_knots": 1,
        "interpolation": "cubic",
        "order": 2,
        "delay": 0.04,
        "basis": None,
        "torque_lag": 0.0,
        "rest_position": None,
        "identification_rate": 100.0,
        "reference": "reference",
        "weighting": "noise",
    },
}
# Values at a bound and beyond it: class, option, accepted value, refused value, and the sentence about the latter.
BOUNDS = [
    (MoespModelOptions, "order", 1, 0, "must be between 1 and 20, got 0"),
    (MoespModelOptions, "order", 20, 21, "must be between 1 and 20, got 21"),
    (MoespModelOptions, "block_rows", 3, 2, "must be between 3 and 200 samples, got 2"),
    (MoespModelOptions, "block_rows", 200, 201, "must be between 3 and 200 samples, got 201"),
    (MoespModelOptions, "delay", 0.0, -1e-09, "must be between 0 and 1 s, got -1e-09"),
    (MoespModelOptions, "delay", 1.0, 1.1, "must be between 0 and 1 s, got 1.1"),
    (MoespModelOptions, "degree", 1, 0, "must be between 1 and 30, got 0"),
    (MoespModelOptions, "degree", 30, 31, "must be between 1 and 30, got 31"),
    (MoespModelOptions, "identification_rate", 1.0, 0.5, "must be between 1 and 10000 Hz, got 0.5"),
    (MoespModelOptions, "identification_rate", 10000.0, 10001.0, "must be between 1 and 10000 Hz, got 10001.0"),
    (MoespModelOptions, "instrument_rows", 1, 0, "must be between 1 and 1000 samples, got 0"),
    (MoespModelOptions, "instrument_rows", 1000, 1001, "must be between 1 and 1000 samples, got 1001"),
    (MoespModelOptions, "instrument_leads", 0, -1, "must be between 0 and 200 samples, got -1"),
    (MoespModelOptions, "instrument_leads", 200, 201, "must be between 0 and 200 samples, got 201"),
    (MoespModelOptions, "rank_tolerance", 0.0, -1e-09, "must be at least 0 and below 1, got -1e-09"),
    (MoespModelOptions, "rank_tolerance", 0.999, 1.0, "must be at least 0 and below 1, got 1.0"),
    (ParallelCascadeOptions, "delay", 0.0, -1e-09, "must be between 0 and 1 s, got -1e-09"),
    (ParallelCascadeOptions, "delay", 1.0, 1.1, "must be between 0 and 1 s, got 1.1"),
    (ParallelCascadeOptions, "identification_rate", 2.0, 0.5, "must be between 1 and 10000 Hz, got 0.5"),
    (ParallelCascadeOptions, "identification_rate", 1000.0, 10001.0, "must be between 1 and 10000 Hz, got 10001.0"),
    (ParallelCascadeOptions, "max_passes", 1, 0, "must be between 1 and 10000, got 0"),
    (ParallelCascadeOptions, "max_passes", 10000, 10001, "must be between 1 and 10000, got 10001"),
    (ParallelCascadeOptions, "tolerance", 0.0, -1e-09, "must be between 0 and 100 points of VAF, got -1e-09"),
    (
        ParallelCascadeOptions,
        "tolerance",
        100.0,
        101.0,
        "must be between 0 and 100 points of VAF, got 101.0",
    ),
    (ParallelCascadeOptions, "intrinsic_lags", 0.0, -1e-09, "must be between 0 and 1 s, got -1e-09"),
    (ParallelCascadeOptions, "intrinsic_lags", 1.0, 1.1, "must be between 0 and 1 s, got 1.1"),
    (ParallelCascadeOptions, "reflex_lags", 0.01, 0.0, "must be between 0.001 and 5 s, got 0.0"),
    (ParallelCascadeOptions, "reflex_lags", 5.0, 5.5, "must be between 0.001 and 5 s, got 5.5"),
    (ParallelCascadeOptions, "rank_tolerance", 0.0, -1e-09, "must be at least 0 and below 1, got -1e-09"),
    (ParallelCascadeOptions, "rank_tolerance", 0.999, 1.0, "must be at least 0 and below 1, got 1.0"),
    (RealTimeOptions, "delay", 0.0, -1e-09, "must be between 0 and 1 s, got -1e-09"),
    (RealTimeOptions, "delay", 1.0, 1.1, "must be between 0 and 1 s, got 1.1"),
    (RealTimeOptions, "identification_rate", 2.0, 0.5, "must be between 1 and 10000 Hz, got 0.5"),
    (RealTimeOptions, "identification_rate", 1000.0, 10001.0, "must be between 1 and 10000 Hz, got 10001.0"),
    (RealTimeOptions, "memory", 0.1, 0.099, "must be between 0.1 and 1e6 s, got 0.099"),
    (RealTimeOptions, "memory", 1000000.0, 1100000.0, "must be between 0.1 and 1e6 s, got 1100000.0"),
    (RealTimeOptions, "settling", 0.0, -1e-09, "must be between 0 and 1e6 s, got -1e-09"),
    (RealTimeOptions, "settling", 1000000.0, 1100000.0, "must be between 0 and 1e6 s, got 1100000.0"),
    (RealTimeOptions, "reflex_lags", 0.01, 0.0, "must be between 0.001 and 5 s, got 0.0"),
    (RealTimeOptions, "reflex_lags", 5.0, 5.5, "must be between 0.001 and 5 s, got 5.5"),
    (RivOptions, "delay", 0.0, -1e-09, "must be between 0 and 1 s, got -1e-09"),
    (RivOptions, "delay", 1.0, 1.1, "must be between 0 and 1 s, got 1.1"),
    (RivOptions, "degree", 1, 0, "must be between 1 and 30, got 0"),
    (RivOptions, "degree", 30, 31, "must be between 1 and 30, got 31"),
    (RivOptions, "identification_rate", 1.0, 0.5, "must be between 1 and 10000 Hz, got 0.5"),
    (RivOptions, "identification_rate", 10000.0, 10001.0, "must be between 1 and 10000 Hz, got 10001.0"),
    (RivOptions, "max_iterations", 1, 0, "must be between 1 and 10000, got 0"),
    (RivOptions, "max_iterations", 10000, 10001, "must be between 1 and 10000, got 10001"),
    (RivOptions, "tolerance", 1e-09, 0.0, "must be above 0 and at most 1, got 0.0"),
    (RivOptions, "tolerance", 1.0, 1.1, "must be above 0 and at most 1, got 1.1"),
    (RivTvOptions, "inertia_knots", 1, 0, "must be between 1 and 200, got 0"),
    (RivTvOptions, "inertia_knots", 200, 201, "must be between 1 and 200, got 201"),
    (RivTvOptions, "delay", 0.0, -1e-09, "must be between 0 and 1 s, got -1e-09"),
    (RivTvOptions, "delay", 1.0, 1.1, "must be between 0 and 1 s, got 1.1"),
    (RivTvOptions, "torque_lag", -0.05, -0.051, "must be between -0.05 and 0.05 s, got -0.051"),
    (RivTvOptions, "torque_lag", 0.05, 0.051, "must be between -0.05 and 0.05 s, got 0.051"),
    (RivTvOptions, "rest_position", -10.0, -10.5, "must be between -10 and 10 rad, got -10.5"),
    (RivTvOptions, "rest_position", 10.0, 10.5, "must be between -10 and 10 rad, got 10.5"),
    (RivTvOptions, "identification_rate", 1.0, 0.5, "must be between 1 and 10000 Hz, got 0.5"),
    (RivTvOptions, "identification_rate", 10000.0, 10001.0, "must be between 1 and 10000 Hz, got 10001.0"),
]
CHOICES = [
    (MoespOptions, "basis", ["chebyshev", "rectifier", "spline"]),
    (MoespOptions, "projection", ["ordinary", "correlation"]),
    (MoespOptions, "input_matrices", ["least-squares", "instruments"]),
    (
        MoespOptions,
        "omitted_step",
        ["kernel-derivatives", "early-nonlinearity", "rank-policy", "scaling", "mean-removal"],
    ),
    (ParallelCascadeOptions, "basis", ["rectifier"]),
    (ParallelCascadeOptions, "rank", ["full", "mdl"]),
    (RealTimeOptions, "basis", ["rectifier"]),
    (RivOptions, "order", [2, 3]),
    (RivOptions, "basis", ["chebyshev", "rectifier", "spline"]),
    (RivOptions, "intervals", ["asymptotic", "robust"]),
    (RivOptions, "weighting", ["noise", "flat"]),
    (RivTvOptions, "interpolation", ["cubic", "constant"]),
    (RivTvOptions, "order", [2, 3]),
    (RivTvOptions, "basis", ["rectifier"]),
    (RivTvOptions, "weighting", ["noise", "flat"]),
]


def parts(annotation):
    """Types of a field, without None."""
    alternatives = [annotation] if get_origin(annotation) is tuple else get_args(annotation) or [annotation]
    return [get_origin(part) or part for part in alternatives if part is not type(None)]


def choices(annotation):
    """Values of a field that is a choice, else nothing."""
    alternatives = [annotation] if get_origin(annotation) is Literal else get_args(annotation)
    return [value for part in alternatives if get_origin(part) is Literal for value in get_args(part)]


# --- defaults


def test_defaults_are_those_of_the_public_face():
    assert list(METHODS) == list(DEFAULTS)
    for method, defaults in DEFAULTS.items():
        assert method_options(method) == defaults, method
        assert METHODS[method].options.parse(method).model_dump() == defaults
    method_options("riv")["order"] = 3
    assert method_options("riv")["order"] == 2


def test_defaults_satisfy_the_bounds():
    for options in CLASSES:
        assert options.parse("a method", **options.defaults()) == options()


def test_options_do_not_change_after_parsing():
    options = RivOptions.parse("riv")
    with pytest.raises(ValueError, match="frozen"):
        options.order = 3


# --- bounds and types


@pytest.mark.parametrize(("options", "name", "accepted", "refused", "sentence"), BOUNDS)
def test_every_bound_is_enforced(options, name, accepted, refused, sentence):
    assert getattr(options.parse("a method", **{name: accepted}), name) == accepted
    with pytest.raises(ValueError, match=f"^{re.escape(f'a method: {name} {sentence}.')}$"):
        options.parse("a method", **{name: refused})


def test_no_bound_lacks_a_test():
    violates = {"ge": operator.lt, "gt": operator.le, "le": operator.gt, "lt": operator.ge}
    for options, name in FIELDS:
        owner = MoespModelOptions if name in MoespModelOptions.model_fields and options is MoespOptions else options
        refused = [row[3] for row in BOUNDS if row[:2] == (owner, name)]
        for key, limit in options.limits(name).items():
            assert any(violates[key](value, limit) for value in refused), (options.__name__, name, key)
    for options, name in FIELDS:
        values = choices(options.model_fields[name].annotation)
        owner = MoespOptions if options is MoespModelOptions else options
        assert ((owner, name, values) in CHOICES) == bool(values), (options.__name__, name)


@pytest.mark.parametrize(("options", "name", "values"), CHOICES)
def test_choices_are_enforced(options, name, values):
    for value in values:
        assert getattr(options.parse("a method", **{name: value}), name) == value
    *others, last = map(repr, values)
    expected = f"one of {', '.join(others)} or {last}" if others else last
    sentence = f"a method: {name} must be {expected}; got 'other'."
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        options.parse("a method", **{name: "other"})


@pytest.mark.parametrize(("options", "name"), FIELDS)
def test_values_of_another_type_are_refused(options, name):
    field = options.model_fields[name]
    kinds = [object] if choices(field.annotation) else parts(field.annotation)
    values = {
        int: [True, 2.5, "2", [2], np.nan, np.float64(2.5), np.arange(1, 4)],
        float: [True, "0.1", np.nan, np.inf, -np.inf, [0.1], 1j, np.array([0.1, 0.2])],
        bool: [1, 0, "true"],
        str: [1, b"reference", ["reference"]],
        object: [True, "", 1.5, ["full"]],
        tuple: [1, b"reference", True, 1j, ["a"], [None, 1.0, 2.0]],
    }[kinds[0]]
    if type(None) not in get_args(field.annotation):
        values = [*values, None]
    else:
        assert getattr(options.parse("a method", **{name: None}), name) is None
    for value in values:
        with pytest.raises(ValueError, match=f"^a method: {name} must be "):
            options.parse("a method", **{name: value})


@pytest.mark.parametrize("method", METHODS)
def test_an_unknown_option_is_refused_with_the_known_ones(method):
    with pytest.raises(TypeError) as refusal:
        METHODS[method](None, ordre=3)
    known = ", ".join(METHODS[method].options.model_fields)
    close = " (did you mean 'order'?)" if "order" in known.split(", ") else ""
    assert str(refusal.value) == f"method {method!r} has no option 'ordre'{close}; it has {known}."
    assert set(known.split(", ")) == set(method_options(method))


@pytest.mark.parametrize("method", METHODS)
def test_options_are_checked_before_the_trial(method):
    with pytest.raises(ValueError, match="identification_rate must be between 1 and 10000 Hz, got -1"):
        METHODS[method](None, identification_rate=-1)


@pytest.mark.parametrize(
    ("name", "value", "plain"),
    [
        ("order", np.int32(3), 3),
        ("order", np.array(3), 3),
        ("order", 3.0, 3),
        ("order", np.float32(3.0), 3),
        ("delay", np.float32(0.5), 0.5),
        ("delay", np.int64(0), 0.0),
        ("identification_rate", 100, 100.0),
        ("free_b", np.bool_(True), True),
        ("basis", np.str_("rectifier"), "rectifier"),
    ],
)
def test_numpy_scalars_are_numbers(name, value, plain):
    parsed = getattr(MoespOptions.parse("a method", **{name: value}), name)
    assert parsed == plain
    assert type(parsed) is type(plain)


def test_numpy_scalars_give_the_estimate_of_plain_numbers(noisy):
    plain = {"order": 3, "delay": 0.05, "degree": 4, "free_b": True}
    options = {"order": np.int16(3), "delay": np.float64(0.05), "degree": np.array(4), "free_b": np.bool_(True)}
    expected, estimate = (ankleloop.identify(noisy, **values) for values in (plain, options))
    assert estimate.torque.identical(expected.torque)
    assert type(estimate.reflex["delay"]) is float
    cascade = {"max_passes": np.int64(2), "reflex_lags": np.float32(0.5)}
    assert ankleloop.identify(noisy, "parallel-cascade", **cascade).diagnostics["passes"] == 2


# --- documentation


@pytest.mark.parametrize(("options", "name"), FIELDS)
def test_every_option_is_documented(options, name):
    """The docstring has its name, type, default, description (null of YAML is None there) and unit."""
    field = options.model_fields[name]
    assert len(field.description) > 10
    unit = options.unit(name)
    description = re.sub(r"\bnull\b", "None", field.description)
    quantity = description + (f" [{unit}]." if unit != "1" else ".")
    entry = re.search(rf"^{name} : (.+), default (.+)\n    (.+)$", options.__doc__, re.MULTILINE)
    assert entry.group(2) == repr(field.default)
    assert entry.group(3) == quantity
    for part in parts(field.annotation):
        assert getattr(part, "__name__", "") in entry.group(1) or all(
            repr(value) in entry.group(1) for value in choices(field.annotation)
        )
    assert ("None" in entry.group(1)) == (type(None) in get_args(field.annotation))


def test_docstrings_list_the_options_in_their_order():
    for options in CLASSES:
        assert re.findall(r"^(\w+) : ", options.__doc__, re.MULTILINE) == list(options.model_fields)
        assert options.__doc__.index("Parameters\n----------") > 0
        assert options.__doc__.splitlines()[0].endswith(".")


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("delay", "s"),
        ("identification_rate", "Hz"),
        ("block_rows", "samples"),
        ("instrument_rows", "samples"),
        ("reflex_lags", "s"),
        ("intrinsic_lags", "s"),
        ("memory", "s"),
        ("settling", "s"),
        ("order", "1"),
        ("degree", "1"),
    ],
)
def test_units(name, unit):
    owners = [options for options in CLASSES if name in options.model_fields]
    assert owners
    for options in owners:
        assert options.unit(name) == unit
        assert options.model_json_schema()["properties"][name]["unit"] == unit


def test_an_error_without_a_unit():
    error = {"type": "greater_than", "input": -1, "ctx": {"gt": 0}}
    assert describe_error(error) == "must be above 0, got -1"
    assert describe_error(error, "s") == "must be above 0 s, got -1"
    assert describe_error(error, "s", {"gt": 0, "le": 60}) == "must be above 0 and at most 60 s, got -1"
