"""Every public function, method and property of the library has annotated arguments and an annotated return."""

import importlib
import inspect
import pkgutil
from functools import cached_property

import pytest

import ankleloop

MODULES = sorted(module.name for module in pkgutil.walk_packages(ankleloop.__path__, "ankleloop."))
CALLED = ("__init__", "__call__")  # special methods whose arguments a caller writes


def is_public(name):
    return not name.startswith("_") or name in CALLED


def underlying_function(member):
    """The function of a method, property or wrapper; None for all else, among it what numba compiles."""
    if isinstance(member, (classmethod, staticmethod)):
        member = member.__func__
    elif isinstance(member, property):
        member = member.fget
    elif isinstance(member, cached_property):
        member = member.func
    try:
        member = inspect.unwrap(member)
    except AttributeError:
        return None
    return member if inspect.isfunction(member) else None


def public_functions(module):
    """Names and functions that are public and defined in a module, with those of its public classes."""
    for name, member in vars(module).items():
        if not is_public(name) or getattr(member, "__module__", None) != module.__name__:
            continue
        if inspect.isclass(member):
            for method_name, method in vars(member).items():
                function = underlying_function(method) if is_public(method_name) else None
                if function is not None and function.__module__ == module.__name__:
                    yield f"{name}.{method_name}", function
        elif not hasattr(member, "py_func"):  # numba derives the types of what it compiles
            function = underlying_function(member)
            if function is not None:
                yield name, function


def missing_annotations(function):
    parameters = list(inspect.signature(function).parameters.values())
    missing = [
        p.name for p in parameters if p.annotation is inspect.Parameter.empty and p.name not in ("self", "cls", "_")
    ]
    if "return" not in function.__annotations__:
        missing.append("return")
    return missing


@pytest.mark.parametrize("name", MODULES)
def test_public_functions_are_annotated(name):
    functions = dict(public_functions(importlib.import_module(name)))
    missing = {name: missing_annotations(function) for name, function in functions.items()}
    assert {name: names for name, names in missing.items() if names} == {}


def test_the_walk_reaches_functions_methods_properties_and_wrappers():
    from ankleloop.joint import dynamics, estimate, prepared, regressors
    from ankleloop.methods import method

    assert set(dict(public_functions(prepared))) >= {"prepare", "PreparedTrial.__init__", "PreparedTrial.regressors"}
    assert set(dict(public_functions(dynamics))) >= {"ReflexDynamics.values", "ReflexDynamics.grid", "fit_dynamics"}
    assert set(dict(public_functions(estimate))) >= {"Estimate.model", "Estimate.predict"}
    assert set(dict(public_functions(regressors))) >= {"JointInputs.centred", "decimation_grid"}
    assert set(dict(public_functions(method))) >= {"Method.__call__", "Method.merges"}
    assert len(MODULES) > 50


def test_a_missing_annotation_is_reported():
    def complete(x: int, *values: float, y: str = "") -> None: ...

    def incomplete(self, x: int, *values, y=""): ...

    assert missing_annotations(complete) == []
    assert missing_annotations(incomplete) == ["values", "y", "return"]
