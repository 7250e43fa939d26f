"""Every option and every argument of a public function refuses what it cannot be, by its name and with its bounds."""

import inspect
import math
from functools import partial
from types import UnionType
from typing import Literal, Union, get_args, get_origin

import numpy as np
import pandas as pd
import pytest

import ankleloop
from ankleloop.assessment.residuals import residual_test
from ankleloop.assessment.scores import in_band_snr, summarise
from ankleloop.methods.moesp import MoespModelOptions
from ankleloop.methods.selection import select_options
from ankleloop.options import Options
from ankleloop.records.reading_options import ReadingOptions
from ankleloop.signals.decimation import decimate, decimation_factor
from ankleloop.signals.differentiation import differentiate
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.subspace.options import MemoryOptions, SubspaceOptions

REQUIRED = {"block_rows": 15, "order": 2, "instruments": "none", "projection": "ordinary", "dt": 1.0}
CLASSES = [
    *dict.fromkeys(method.options for method in ankleloop.METHODS.values()),
    MoespModelOptions,
    SimulationSettings,
    SubspaceOptions,
    MemoryOptions,
    ReadingOptions,
]
FIELDS = [(options, name) for options in CLASSES for name in options.model_fields]
IDS = [f"{options.__name__}-{name}" for options, name in FIELDS]
VALUES = [
    None, "no", "1", b"1", math.nan, math.inf, -math.inf, -1, -1.0, 0, 1, 2.0, 2.5, 1e12, 1e160, 1e-160, 10**400,
    True, False, 1j, [], {}, [1], (), np.array([0.1, 0.2]), np.bool_(True), object(),
]  # fmt: skip


def types_of(annotation):
    """Types of a field, and whether None is one of them."""
    members = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else [annotation]
    return [member for member in members if member is not type(None)], type(None) in members


def is_within(value, ge=-math.inf, gt=-math.inf, le=math.inf, lt=math.inf):
    return ge <= value <= le and gt < value < lt


def is_valid(options, name, value):
    """Whether the declaration of a field allows a value."""
    kinds, optional = types_of(options.model_fields[name].annotation)
    plain = value.item() if isinstance(value, np.generic) else value
    if plain is None:
        return optional
    return any(is_of_kind(options, name, kind, plain) for kind in kinds)


def is_of_kind(options, name, kind, plain):
    if get_origin(kind) is tuple:
        lengths = {len(get_args(kind))} if ... not in get_args(kind) else range(1001)
        return isinstance(plain, (list, tuple, np.ndarray)) and len(plain) in lengths
    if get_origin(kind) is Literal:
        return type(plain) is not bool and plain in get_args(kind) if isinstance(plain, (str, int, float)) else False
    if kind is int:
        whole = type(plain) is int or (type(plain) is float and plain.is_integer())
        return whole and is_within(plain, **options.limits(name))
    if kind is float:
        return type(plain) in (int, float) and math.isfinite(plain) and is_within(plain, **options.limits(name))
    return type(plain) is kind


def required(options):
    return REQUIRED if issubclass(options, SubspaceOptions) else {}


@pytest.mark.parametrize(("options", "name"), FIELDS, ids=IDS)
def test_every_option_takes_its_values_and_refuses_all_others(options, name):
    if name in ("names", "variables"):
        pytest.skip("names are texts in a tuple or in pairs, which their own tests cover")
    limits = options.limits(name)
    for value in VALUES:
        if isinstance(value, int) and abs(value) > 1e300 and not limits:
            continue
        try:
            valid = is_valid(options, name, value)
        except OverflowError:
            valid = False
        try:
            parsed = getattr(options.parse("the method", **{**required(options), name: value}), name)
        except ValueError as error:
            message = str(error)
            assert message.startswith("the method: ")
            assert name in message
            if not valid:  # a valid value may be refused because of another option, whose name the message has
                for bound in limits.values():
                    assert f"{bound:.6g}".replace("e+", "e").replace("e0", "e").replace("e-0", "e-") in message
                assert options.unit(name) in message or options.unit(name) == "1"
            elif value is not None:
                assert " must be " in message
        else:
            assert valid, value
            assert parsed == (tuple(value) if isinstance(value, (list, np.ndarray)) else value)


@pytest.mark.parametrize(("options", "name"), FIELDS, ids=IDS)
def test_every_number_has_a_lower_and_an_upper_bound(options, name):
    (kind, *_), _ = types_of(options.model_fields[name].annotation)
    limits = options.limits(name)
    if kind in (int, float):
        assert {"ge", "gt"} & set(limits)
        assert {"le", "lt"} & set(limits)
    else:
        assert not {"le", "lt"} & set(limits)


@pytest.mark.parametrize("options", CLASSES, ids=[options.__name__ for options in CLASSES])
def test_a_misspelt_name_suggests_the_right_one(options: type[Options]):
    for name in options.model_fields:
        if len(name) > 3:
            misspelt = name[0] + name[2] + name[1] + name[3:]
            if misspelt in options.model_fields:
                continue
            with pytest.raises(TypeError) as refusal:
                options.parse("the method", **{misspelt: 1})
            assert f"has no option {misspelt!r} (did you mean {name!r}?); it has " in str(refusal.value)


# --- functions

NUMBERS = ["no", math.nan, math.inf, -math.inf, True, [], {}, 1j]
FLAGS = [None, "no", "yes", 1, 0, math.nan, []]
CHOICES = ["no", 1, True, math.nan, [], {}]
PATHS = [None, True, 1.5, [], {}]
SIGNALS = ["no", math.nan, True, {}, ["a"], [1j, 2j], [[1.0, 2.0], [3.0]]]
TRIALS = ["no", math.nan, True, {}, None, 1]
SEEDS = [None, "no", math.nan, math.inf, -1, 2.5, True, [], {}]
RATES = [*NUMBERS, None, -1, 0, 1e12]
WHOLE = [*NUMBERS, 2.5, -1]
DELAYS = [*NUMBERS, -0.1, 1.1]
METHOD = ["no", None, True, 1, [], {}]
OPTIONS = ["order", "delay"]  # of the method, which are checked above
OVERWRITE = {"overwrite": FLAGS}

# Wrong values of every argument of every public function.
ARGUMENTS = {
    "block_bootstrap": {
        "trial": TRIALS,
        "method": METHOD,
        "repetitions": [*WHOLE, None, 1, 1e12],
        "block": [*NUMBERS, None, 0, -1, 1e12],
        "seed": [*WHOLE, None],
        "progress": ["no", 1, True, []],
    },
    "check_trial": {
        "trial": [*TRIALS, []],
        "reference": [None, 1, True, []],
        "delay": [*DELAYS, None],
        "order": [*WHOLE, None, 0, 1e12],
        "block_rows": [*WHOLE, None, 2, 1e5],
        "identification_rate": [*RATES, 1e-9],
    },
    "cramer_rao": {
        "seed": SEEDS,
        "identification_rate": [*RATES, 1e-9],
        "fed_back": FLAGS,
        "known_delay": FLAGS,
    },
    "evaluate": {
        "trial": TRIALS,
        "estimate": TRIALS,
        "trim": [*NUMBERS, None, -1, 1e12],
        "against": CHOICES,
        "intervals": FLAGS,
    },
    "identify": {
        "trial": [*TRIALS, []],
        "method": METHOD,
        "select": ["no", 1, True, [], {"order": []}, {"order": 2}, {"order": [1, 2.5]}, {"order": range(1, 2000)}],
        "criterion": [*CHOICES, "instrumental"],
    },
    "identify_file": {
        "record": TRIALS,
        "output": PATHS,
        "method": METHOD,
        "chunk": [*WHOLE, None, 0, 1e12],
        "progress": ["no", 1, True, []],
        **OVERWRITE,
    },
    "load_estimate": {"path": PATHS},
    "load_trial": {"path": PATHS},
    "method_options": {"method": METHOD},
    "new_trial": {
        "position": [*SIGNALS, None],
        "torque": [*SIGNALS, None],
        "sampling_rate": RATES,
        "reference": SIGNALS,
    },
    "read_trial": {
        "path": PATHS,
        "position": [None, 1, True, []],
        "torque": [None, 1, True, []],
        "reference": [1, True, []],
        "sampling_rate": [rate for rate in RATES if rate is not None],
        "position_unit": [None, *CHOICES],
        "position_sign": [None, "no", 0, 2, 0.5, True, math.nan, []],
        "torque_sign": [None, "no", 0, 2, 0.5, True, math.nan, []],
        "variables": ["no", 1, True, [], {"a": 1}],
    },
    "save_estimate": {"estimate": TRIALS, "path": PATHS, **OVERWRITE},
    "save_trial": {"trial": TRIALS, "path": PATHS, **OVERWRITE},
    "segment": {
        "trial": TRIALS,
        "start": [*NUMBERS, None],
        "stop": [*NUMBERS, None],
    },
    "simulate": {"seed": SEEDS, "load": ["no", 1, True, [], [1.0, 2.0], [0.0, 1.0, 1.0], [1.0, math.nan, 1.0], {}]},
    "trajectory_bound": {
        "seed": SEEDS,
        "knots": ["no", None, 12, [], (12, 8), (12, 8, 0), (12, 8, 2.5), (12, 8, math.nan)],
        "identification_rate": [*RATES, 1e-9],
        "known_delay": FLAGS,
    },
    "vaf": {"measured": [*SIGNALS, None], "estimated": [*SIGNALS, None]},
}
NOT_FUNCTIONS = {"METHODS", "DataError", "Estimate", "LongRecord", "UnstableLoopError", "subspace"}


@pytest.fixture(scope="module")
def trial():
    return ankleloop.simulate(seed=1, duration=10.0)


@pytest.fixture(scope="module")
def values(trial, tmp_path_factory):
    """Right values of the arguments that have no default."""
    folder = tmp_path_factory.mktemp("arguments")
    estimate = ankleloop.identify(trial, "pr-moesp")
    ankleloop.save_trial(trial, folder / "trial.nc")
    return {
        "block_bootstrap": {"trial": trial, "method": "pr-moesp"},
        "check_trial": {"trial": trial},
        "cramer_rao": {"seed": 1, "duration": 2.0},
        "evaluate": {"trial": trial, "estimate": estimate},
        "identify": {"trial": trial},
        "identify_file": {"record": ankleloop.LongRecord(folder / "trial.nc"), "output": folder / "torques.nc"},
        "load_estimate": {},
        "load_trial": {},
        "method_options": {},
        "new_trial": {"position": trial.position.values, "torque": trial.torque.values, "sampling_rate": 1000.0},
        "read_trial": {"path": folder / "trial.nc"},
        "save_estimate": {"estimate": estimate, "path": folder / "estimate.nc"},
        "save_trial": {"trial": trial, "path": folder / "other.nc"},
        "segment": {"trial": trial, "start": 0.0, "stop": 5.0},
        "simulate": {"seed": 1, "duration": 2.0},
        "trajectory_bound": {"seed": 1, "duration": 20.0, "variation": "cycle"},
        "vaf": {"measured": [1.0, 2.0], "estimated": [1.0, 2.0]},
    }


def refuse(function, name, value, **arguments):
    """The function refuses a value of an argument by its name."""
    with pytest.raises((ValueError, TypeError)) as refusal:
        function(**{**arguments, name: value})
    assert type(refusal.value) in (ValueError, TypeError, ankleloop.DataError), value
    assert name in str(refusal.value), (value, str(refusal.value))
    assert len(str(refusal.value)) < 600


def test_no_public_name_and_no_argument_lacks_its_wrong_values():
    assert set(ARGUMENTS) | NOT_FUNCTIONS == set(ankleloop.__all__)
    for function, arguments in ARGUMENTS.items():
        parameters = inspect.signature(getattr(ankleloop, function)).parameters
        variable = (inspect.Parameter.VAR_KEYWORD,)
        names = {name for name, parameter in parameters.items() if parameter.kind not in variable}
        settings = set(SimulationSettings.model_fields) if function == "simulate" else set()
        assert set(arguments) == names - settings, function


@pytest.mark.parametrize(
    ("function", "name"), [(function, name) for function, arguments in ARGUMENTS.items() for name in arguments]
)
def test_every_argument_of_a_public_function_refuses_what_it_cannot_be(values, function, name):
    for value in ARGUMENTS[function][name]:
        refuse(getattr(ankleloop, function), name, value, **values[function])


@pytest.mark.parametrize("value", ["no", None, [], 1e12, math.nan, -1, True])
def test_functions_that_take_settings_or_options_refuse_wrong_ones(trial, value):
    refuse(ankleloop.simulate, "duration", value, seed=1)
    refuse(ankleloop.cramer_rao, "duration", value, seed=1)
    refuse(ankleloop.trajectory_bound, "duration", value, seed=1, variation="cycle")
    refuse(ankleloop.block_bootstrap, "degree", value, trial=trial, method="riv")
    refuse(ankleloop.identify, "degree", value, trial=trial)


SIGNAL = np.random.default_rng(0).standard_normal((2, 4000))
INNER = [
    (decimation_factor, {"sampling_rate": 1000.0, "identification_rate": 100.0}, "identification_rate", RATES),
    (decimation_factor, {"sampling_rate": 1000.0, "identification_rate": 100.0}, "sampling_rate", RATES[:-1]),
    (partial(decimate, SIGNAL), {"factor": 10, "first": 500, "count": 5}, "factor", [*WHOLE, None, 0, 1e12]),
    (partial(decimate, SIGNAL), {"factor": 10, "first": 500, "count": 5}, "first", [*NUMBERS, None, 2.5]),
    (partial(decimate, SIGNAL), {"factor": 10, "first": 500, "count": 5}, "count", [*NUMBERS, None, 2.5]),
    (partial(decimate, SIGNAL, 10, 500, 5), {}, "rate", [*NUMBERS, None, 0, -1]),
    (partial(decimate, SIGNAL, 10, 500, 5), {}, "derivative", [*WHOLE, None, 3]),
    (partial(differentiate, SIGNAL[0]), {"rate": 1000.0}, "rate", [*NUMBERS, None, 0, -1, 1e12]),
    (partial(differentiate, SIGNAL[0]), {"rate": 1000.0}, "delay", [*NUMBERS, None, 1e12]),
    (partial(residual_test, *SIGNAL), {"rate": 100.0}, "rate", [*NUMBERS, None, 0, -1, 1e12]),
    (partial(residual_test, *SIGNAL), {"rate": 100.0}, "lags", [*NUMBERS, None, -1, 1e12]),
    (partial(summarise, pd.DataFrame({"torque": ["net"], "vaf": [90.0]})), {}, "by", ["torque", 1, None, ["no"], [1]]),
    (ankleloop.subspace.block_hankel, {"x": SIGNAL.T, "first": 0, "rows": 3, "columns": 5}, "first", [*NUMBERS, 2.5]),
    (ankleloop.subspace.block_hankel, {"x": SIGNAL.T, "first": 0, "rows": 3, "columns": 5}, "rows", [*WHOLE, 1e12]),
    (ankleloop.subspace.block_hankel, {"x": SIGNAL.T, "first": 0, "rows": 3, "columns": 5}, "columns", [*WHOLE, 1e12]),
    (ankleloop.subspace.moesp_chunks, {"block_rows": 8, "order": 1}, "chunks", ["no", None, 1, []]),
]


@pytest.mark.parametrize(
    ("function", "arguments", "name", "wrong"), INNER, ids=[f"{k}-{case[2]}" for k, case in enumerate(INNER)]
)
def test_every_argument_of_an_inner_function_refuses_what_it_cannot_be(function, arguments, name, wrong):
    for value in wrong:
        refuse(function, name, value, **arguments)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("u", [*SIGNALS, None]),
        ("y", [*SIGNALS, None]),
        ("reference", SIGNALS),
        ("block_rows", [*WHOLE, None, 1, 1e5]),
        ("order", [*WHOLE, 0, 1e12]),
        ("instruments", [None, *CHOICES]),
        ("projection", [None, *CHOICES]),
        ("dt", [*NUMBERS, None, 0, -1, 1e160]),
        ("dynamic", ["no", math.nan, 1, True, [], [True], [True] * 3, [1, 0], {}]),
        ("predicted_inputs", [*SIGNALS, SIGNAL.T[:, :1], SIGNAL.T[:7]]),
        ("names", ["no", 1, True, [], [["a"], ["b"]], [["a", "b"], ["c", "d"]], ["ab", "c"], [["a", 1], ["b"]]]),
        ("rank_tolerance", [*NUMBERS, None, -1, 1]),
        ("instrument_rows", [*WHOLE, 0, 1e5]),
        ("scaling", FLAGS),
        ("offsets", FLAGS),
    ],
)
def test_every_argument_of_moesp_refuses_what_it_cannot_be(name, wrong):
    u, y = SIGNAL.T, SIGNAL.sum(axis=0)[:, None]
    options = {"instruments": "past-reference", "reference": SIGNAL[0]} if name == "reference" else {}
    if name == "predicted_inputs":
        options["input_matrices"] = "instruments"
    names = {"u": "input", "y": "output"}
    for value in wrong:
        with pytest.raises((ValueError, TypeError)) as refusal:
            ankleloop.subspace.moesp(**{"u": u, "y": y, "block_rows": 5, "order": 1, **options, name: value})
        assert names.get(name, name) in str(refusal.value), (value, str(refusal.value))


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("candidates", ["no", 1, None, {}, {"order": []}, {"order": 2}, {1: [2]}]),
        ("criterion", CHOICES),
        ("reference", [None, 1, True]),
        ("delay", DELAYS),
        ("identification_rate", [*RATES, 1e-9]),
        ("folds", [*WHOLE, None, 0, 1, 1e12]),
        ("merges", FLAGS),
    ],
)
def test_every_argument_of_a_selection_refuses_what_it_cannot_be(trial, name, wrong):
    def fit(*_, **__):
        raise AssertionError("nothing is fitted with a wrong argument")

    for value in wrong:
        refuse(select_options, name, value, **{"trial": trial, "fit": fit, "candidates": {"order": [2]}})


def test_the_trim_of_every_score_is_checked(values):
    arguments = values["evaluate"]
    for value in (*NUMBERS, None, -1):
        refuse(in_band_snr, "trim", value, **arguments)
