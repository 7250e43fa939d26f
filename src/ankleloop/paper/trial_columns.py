"""Columns of the table of the trials of a study: their order, their types, their units and what they are."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Literal

from ankleloop.methods.registry import METHODS
from ankleloop.options import Options
from ankleloop.paper.sweep_quantities import SWEEP_QUANTITIES
from ankleloop.quantities import QUANTITIES, Quantity
from ankleloop.simulation.settings import SimulationSettings

Kind = Literal["number", "count", "flag", "text"]

FIRST, FAULTS = ("study", "point"), ("failure", "warnings")
TEXTS = {*FIRST, *FAULTS, "method", "torque", "against", "reference", "intervals"}
COUNTS = {"trial", "order", "passes", "cycles"}
FLAGS = {"converged", "stable"}
ENDS = {"_low": "lower end of the 95 % interval of the ", "_high": "upper end of the 95 % interval of the "}
ESTIMATED = "_estimated"  # ending of an estimate whose name is that of a parameter of the sweep
OTHERS = {
    "study": Quantity("study", "study", "1"),
    "point": Quantity("point of the study", "point", "1"),
    "method": Quantity("name of the method in the study", "method", "1"),
    "trial": Quantity("number of the trial at its point", "trial", "1"),
    "reference": Quantity("signal that served as reference", "reference", "1"),
    "intervals": Quantity("kind of the intervals", "intervals", "1"),
    "converged": Quantity("whether the iteration converged", "converged", "1"),
    "stable": Quantity("whether the model is stable", "stable", "1"),
    "failure": Quantity("why there is no estimate; empty where there is one", "failure", "1"),
    "warnings": Quantity("warnings that came with the estimate", "warnings", "1"),
}
ORDER = [*QUANTITIES, *SWEEP_QUANTITIES]


def score_columns(torque: str, against: str) -> tuple[str, str, str]:
    """Columns of a VAF and of the ends of its interval."""
    name = f"vaf_{torque}_{against}"
    return name, f"{name}_low", f"{name}_high"


def column_kind(name: str) -> Kind:
    """Kind of the values of a column that is no parameter of the sweep."""
    name = name.removesuffix(ESTIMATED)
    if name in TEXTS:
        return "text"
    return "count" if name in COUNTS else "flag" if name in FLAGS else "number"


def value_kind(values: Iterable[str]) -> Kind:
    """Kind of the values of a parameter of the sweep, as tables write them; empty is no value."""
    present = {value for value in values if value}
    if not present:
        return "number"
    if present <= {"True", "False"}:
        return "flag"
    if all(value.removeprefix("-").isdecimal() and len(value) < 19 for value in present):
        return "count"
    return "number" if all(map(_is_number, present)) else "text"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def order_columns(names: Collection[str], varied: Sequence[str], scores: Collection[tuple[str, str]]) -> list[str]:
    """All columns of a table of trials in their fixed order."""
    ranks = {name: rank for rank, name in enumerate(ORDER)}
    first = [*FIRST, *varied, "method", "trial"]
    pairs = sorted(scores, key=lambda pair: (ranks.get(score_columns(*pair)[0], len(ranks)), pair))
    vaf = [name for pair in pairs for name in score_columns(*pair)]
    rest = set(names) - {*first, *vaf, *FAULTS}

    def key(name: str) -> tuple[int, str, int]:
        base, end = _split_end(name)
        quantity = base.removesuffix(ESTIMATED)
        return ranks.get(quantity, len(ranks)), base, ["", *ENDS].index(end)

    return [*first, *vaf, *sorted(rest, key=key), *FAULTS]


def _split_end(name: str) -> tuple[str, str]:
    """Name of a quantity, and `_low` or `_high` where the column is an end of its interval."""
    end = next((end for end in ENDS if name.endswith(end)), "")
    return name.removesuffix(end), end


def describe_column(name: str, varied: Collection[str] = ()) -> Mapping[str, str]:
    """Unit and description of a column."""
    if name in varied:
        return _describe_parameter(name)
    base, end = _split_end(name)
    base = base.removesuffix(ESTIMATED)
    quantity = OTHERS.get(base) or SWEEP_QUANTITIES.get(base) or QUANTITIES.get(base) or Quantity(base, base, "1")
    return {"unit": quantity.unit, "description": ENDS.get(end, "") + quantity.name}


def _describe_parameter(name: str) -> Mapping[str, str]:
    models: list[type[Options]] = [SimulationSettings, *(method.options for method in METHODS.values())]
    option = name.rpartition(".")[2]
    for model in models:
        if option in model.model_fields:
            return {"unit": model.unit(option), "description": model.model_fields[option].description or option}
    return {"unit": "1", "description": name}
