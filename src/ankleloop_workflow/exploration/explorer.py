"""Widgets over an experiment of two methods: every change simulates, identifies and draws it."""

from __future__ import annotations

from collections.abc import Mapping
from types import NoneType
from typing import Any, get_args

import ipywidgets as widgets
import numpy as np
import pandas as pd
from IPython.display import display

from ankleloop.errors import NUMERICAL_ERRORS
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.moesp import MoespOptions
from ankleloop.methods.registry import JOINT_METHODS, identify
from ankleloop.options import Options, union_members
from ankleloop.plotting.estimates import torque_figure
from ankleloop.quantities import QUANTITIES, SETTINGS
from ankleloop.simulation.settings import LOAD_SETTINGS, SimulationSettings
from ankleloop.simulation.simulate import simulate

SEED = 1
DURATION = 20.0  # s of a record
START = {"A": "pr-moesp", "B": "riv"}  # methods at the start

# Lowest and highest value of a slider, and its step; on a logarithmic scale that of the logarithm to base 10.
Range = tuple[float, float, float]
SLIDERS: Mapping[str, Range | None] = {
    "load_stiffness": (10.0, 10_000.0, 0.05),
    "load_viscosity": (0.1, 100.0, 0.05),
    "load_inertia": (0.01, 10.0, 0.05),
    "reflex_gain": (0.0, 40.0, 0.5),
    "delay": (0.01, 0.1, 0.001),
    "snr_db": (0.0, 60.0, 1.0),
    "voluntary": (0.0, 2.0, 0.05),
    "perturbation": None,
    "closed_loop": None,
}
OPTIONS: Mapping[str, Range | None] = {
    "order": (1, 6, 1),
    "block_rows": (5, 40, 1),
    "basis": None,
    "delay": (0.01, 0.1, 0.001),
}
LABELS = {
    "delay": "reflex delay",
    "snr_db": "signal-to-noise ratio",
    "voluntary": "voluntary torque, relative",
}
LOOK: Mapping[str, Any] = {"style": {"description_width": "170px"}, "layout": {"width": "430px"}}


def explore() -> widgets.Widget:
    """Sliders of an experiment, and below them its torques, its parameters, and what the methods warn of."""
    controls = make_controls()
    columns: dict[str, list[widgets.Widget]] = {}
    for name, widget in controls.items():
        letter = name[0] if name[0] in START else ""
        columns.setdefault(letter, []).append(widget)
    boxes = [widgets.VBox(column) for column in columns.values()]
    view = widgets.interactive_output(show_experiment, controls)
    return widgets.VBox([widgets.HBox(boxes), view])


def make_controls() -> dict[str, widgets.Widget]:
    """Widgets of settings by their names, and of each method and its options by the letter and the name."""
    controls = {
        name: make_widget(SimulationSettings, name, limits) for name, limits in SLIDERS.items()
    }
    for letter, method in START.items():
        methods = widgets.Dropdown(
            description=f"method {letter}", options=list(JOINT_METHODS), value=method, **LOOK
        )
        controls[f"{letter} method"] = methods
        for name, limits in OPTIONS.items():
            controls[f"{letter} {name}"] = make_widget(MoespOptions, name, limits)
    return controls


def make_widget(model: type[Options], name: str, limits: Range | None) -> widgets.Widget:
    """Widget of a setting or an option, with its default."""
    default = model.defaults()[name]
    unit = model.unit(name)
    label = LABELS.get(name, name.replace("_", " "))
    if unit != "1":
        label = f"{label} [{unit}]"
    shared = {"description": label, "value": default, **LOOK}
    if isinstance(default, bool):
        return widgets.Checkbox(**shared)
    if limits is None:
        return widgets.Dropdown(options=_list_choices(model, name), **shared)
    low, high, step = limits
    slider = {**shared, "step": step, "continuous_update": False}
    if isinstance(default, int):
        return widgets.IntSlider(min=low, max=high, **slider)
    slider["readout_format"] = ".3g"
    if name in LOAD_SETTINGS:
        return widgets.FloatLogSlider(min=np.log10(low), max=np.log10(high), **slider)
    return widgets.FloatSlider(min=low, max=high, **slider)


def _list_choices(model: type[Options], name: str) -> list[tuple[str, str | None]]:
    """Words of a setting or an option with their values; without a word it is the method's own."""
    members = union_members(model.model_fields[name].annotation)
    own = [("the method's own", None)] if NoneType in members else []
    return own + [(value, value) for member in members for value in get_args(member)]


def show_experiment(**values: Any) -> None:
    """Simulate, identify and show; what cannot be simulated or identified is a sentence."""
    settings = {name: values[name] for name in SLIDERS}
    try:
        trial = prepare(simulate(seed=SEED, duration=DURATION, **settings))
    except NUMERICAL_ERRORS as error:
        print(error)
        return
    estimates = {}
    remarks = []
    for letter in START:
        method = values[f"{letter} method"]
        label = f"{letter}: {method}"
        known = JOINT_METHODS[method].options.model_fields
        options = {name: values[f"{letter} {name}"] for name in OPTIONS if name in known}
        try:
            estimate = identify(trial, method, **options)
            estimates[label] = estimate
            remarks += [f"{label}: {text}" for text in estimate.diagnostics["warnings"]]
        except NUMERICAL_ERRORS as error:
            remarks.append(f"{label}: {error}")
    if estimates:
        display(torque_figure(trial, estimates, start=0.5 * DURATION))
    display(tabulate_parameters(settings, estimates))
    print("\n".join(remarks))


def tabulate_parameters(
    settings: Mapping[str, Any], estimates: Mapping[str, Estimate]
) -> pd.DataFrame:
    """True and estimated parameters as text, with 95 % intervals where there are some."""
    model = SimulationSettings(**settings)
    table = pd.DataFrame(index=list(SETTINGS))
    table["true"] = [f"{getattr(model, setting):.3g}" for setting in SETTINGS.values()]
    for label, estimate in estimates.items():
        values = estimate.values
        cells = {name: f"{value:.3g}" for name, value in values.items()}
        for name in cells.keys() & estimate.intervals:
            low, high = estimate.intervals[name]
            cells[name] += f" ({low:.3g} … {high:.3g})"
        table[label] = pd.Series(cells)
    return table.fillna("–").rename(index=lambda name: QUANTITIES[name].label)
