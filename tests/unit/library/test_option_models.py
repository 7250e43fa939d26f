"""Every option model: a wrong type, a value out of range and an unknown name are refused, by the option's name."""

import math
from typing import Literal, get_args, get_origin

import numpy as np
import pytest

import ankleloop
from ankleloop import METHODS, method_options
from ankleloop.methods.moesp import MoespOptions
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.subspace.sources import SubspaceOptions
from ankleloop_lab.files.reading_options import ReadingOptions

REQUIRED = {
    "block_rows": 15,
    "order": 2,
    "instruments": "none",
    "projection": "ordinary",
    "dt": 1.0,
}
MODELS = [
    *dict.fromkeys(method.options for method in METHODS.values()),
    *(SimulationSettings, SubspaceOptions, ReadingOptions),
]
FIELDS = [
    pytest.param(model, name, id=f"{model.__name__}-{name}")
    for model in MODELS
    for name in model.model_fields
    if name not in ("names", "variables")  # texts in a tuple or in pairs
]
WRONG = [b"1", math.nan, math.inf, -math.inf, 1j, {}, object(), 10**400, np.array([[[0.1, 0.2]]])]
TEXTS = ["", "no", "1"]


def parse(model, **values):
    required = REQUIRED if issubclass(model, SubspaceOptions) else {}
    return model.parse("the method", **{**required, **values})


def types_of(model, name):
    """Types of a field without None, and whether None is one of them."""
    annotation = model.model_fields[name].annotation
    members = (
        get_args(annotation)
        if get_origin(annotation) not in (None, tuple, Literal)
        else [annotation]
    )
    return [get_origin(member) or member for member in members if member is not type(None)], type(
        None
    ) in members


@pytest.mark.parametrize(("model", "name"), FIELDS)
def test_wrong_types_are_refused_by_the_name_of_the_option(model, name):
    kinds, optional = types_of(model, name)
    wrong = (
        WRONG
        + ([] if str in kinds else TEXTS)
        + ([] if bool in kinds or name.endswith("_sign") else [True])
        + ([] if optional else [None])
    )
    wrong += [2.5] if int in kinds else []
    for value in wrong:
        with pytest.raises(ValueError, match=f"^the method: .*{name}"):
            parse(model, **{name: value})


@pytest.mark.parametrize(("model", "name"), FIELDS)
def test_values_out_of_range_are_refused_with_the_range_and_its_unit(model, name):
    for bound, limit in model.limits(name).items():
        outside = math.nextafter(limit, -math.inf if bound in ("ge", "gt") else math.inf)
        outside = (
            (math.ceil(limit) - 1 if bound == "ge" else limit + 1)
            if int in types_of(model, name)[0]
            else outside
        )
        for value in [outside, *([limit] if bound in ("gt", "lt") else [])]:
            with pytest.raises(ValueError, match=f"^the method: {name} must be ") as refusal:
                parse(model, **{name: value})
            assert model.unit(name) in str(refusal.value) or model.unit(name) == "1"
    if {int, float} & set(types_of(model, name)[0]):
        assert {"ge", "gt"} & set(model.limits(name))
        assert {"le", "lt"} & set(model.limits(name))


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_a_misspelt_name_suggests_the_right_one(model):
    for name in model.model_fields:
        misspelt = name[0] + name[2:3] + name[1] + name[3:]
        if len(name) > 3 and misspelt not in model.model_fields:
            with pytest.raises(TypeError) as refusal:
                parse(model, **{misspelt: 1})
            assert f"has no option {misspelt!r} (did you mean {name!r}?); it has " in str(
                refusal.value
            )


def test_defaults_of_methods_are_valid_and_cannot_be_changed():
    for name, method in METHODS.items():
        assert method.options.parse(name, **method_options(name)) == method.options()
    method_options("riv")["order"] = 3
    assert method_options("riv")["order"] == 2


def test_options_are_checked_before_the_trial():
    with pytest.raises(
        ValueError, match="identification_rate must be between 1 and 10000 Hz, got -1"
    ):
        METHODS["riv"](None, identification_rate=-1)


def test_numpy_scalars_are_numbers():
    trial = ankleloop.simulate(seed=1, duration=10.0)
    plain = {"order": 3, "delay": 0.05, "degree": 4, "free_b": True}
    options = {
        "order": np.int16(3),
        "delay": np.float64(0.05),
        "degree": np.array(4),
        "free_b": np.bool_(True),
    }
    assert ankleloop.identify(trial, "pr-moesp", **options) == ankleloop.identify(
        trial, "pr-moesp", **plain
    )
    parsed = MoespOptions.parse("the method", order=np.float32(3.0))
    assert type(parsed.order) is int
