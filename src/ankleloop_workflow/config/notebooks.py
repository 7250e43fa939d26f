"""The notebooks that render studies, from the list beside them, and what a notebook needs of a study."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Literal

import yaml

from ankleloop.options import Options, option
from ankleloop.quantities import SETTINGS
from ankleloop.trials.files import PathLike
from ankleloop_lab.checking import check
from ankleloop_workflow.config.points import SIMULATION
from ankleloop_workflow.config.study import SimulatedStudy, Study

# An installed package has a copy of the folder of the repository.
FOLDERS = [Path(__file__).parents[1] / "notebooks", Path(__file__).parents[3] / "notebooks"]
LIST = next(filter(Path.exists, FOLDERS), FOLDERS[-1]) / "notebooks.yaml"

Need = Literal[
    "trials",
    "estimates",
    "a setting",
    "one setting",
    "one abscissa",
    "settings",
    "numbers",
    "truths",
    "shared truths",
    "real-time",
    "riv",
    "cascade",
    "cascades",
    "table 1",
    "delay",
    "select",
    "variation",
    "trajectories",
    "bound",
    "trajectory bound",
    "usual perturbation",
    "complete point",
]
Prediction = Literal["known delay", "unknown delay", "reference alone", "trajectories", "pilots"]
TRUTHS = {SETTINGS[name] for name in ("K", "B", "I", "G")}
# Settings of a perturbation; points that differ in nothing else are compared with the usual one.
PERTURBATION = (
    "perturbation",
    "amplitude",
    "switching_interval",
    "pulse_length",
    "dwell_weights",
    "torque_level",
)
NO_BOUND = ("reflex_threshold", "variation", "movement", "locked_torque")  # where one is not 0


class ConditionalFigure(Options):
    """A figure that is drawn where a study has what it shows."""

    caption: str = option(description="what it shows")
    has: Literal["singular values", "conditions"] = option(description="what a study has")


class Notebook(Options):
    """A notebook that renders studies."""

    kind: Literal["simulation", "recordings"] = option("simulation", "kind of its studies")
    shows: str = option(description="what its page and its table show")
    figures: dict[str, str] = option(description="captions of its figures by their names")
    conditional: dict[str, ConditionalFigure] = option(
        {}, "figures that are drawn where a study has what they show"
    )
    reads: list[Literal["trials", "estimates", "points", "ledger"]] = option(
        ["points"], "what it reads beside the table of all trials"
    )
    published: list[str] = option([], "files that it reads, in data/published")
    predictions: dict[Prediction, int] = option(
        {}, "kinds of predictions that it reads, each with its number of seeds"
    )
    needs: list[Need] = option([], "what a study must have, see `find_needs`")


def read_notebooks(path: PathLike = LIST) -> dict[str, Notebook]:
    """The notebooks of a list."""
    entries = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    return {name: check(Notebook, entry, str(path), name) for name, entry in entries.items()}


def list_figures(study: Study, notebook: Notebook | None) -> dict[str, str]:
    """Captions of the figures that a notebook draws of a study, by name."""
    if notebook is None:
        return {}
    has = {
        "singular values": any(
            method.method.endswith("moesp") for method in study.methods.values()
        ),
        "conditions": _has_conditions(study),
    }
    more = {name: part.caption for name, part in notebook.conditional.items() if has[part.has]}
    return {**notebook.figures, **more}


def _has_conditions(study: Study) -> bool:
    """Whether the recordings have several subjects and several conditions."""
    for group in ("subject", "condition"):
        values = {point.get(group) for point in study.points.values()}
        if len(values) < 2 or "" in values:
            return False
    return True


def find_needs(study: SimulatedStudy) -> dict[str, str]:
    """What the study lacks of the needs that a notebook may have, in words by the need."""
    keep = study.settings.keep
    varied = study.varied
    methods = study.methods
    points = study.points.values()
    algorithms = [method.method for method in methods.values()]
    listed = ", ".join(algorithms)
    names = ", ".join(varied) or "none"
    options = [
        name for name, parameter in study.parameters.items() if SIMULATION not in parameter.owners
    ]
    # The loops have curves of their own.
    numeric = [name for name in varied if name != "closed_loop"]
    places = {tuple(settings[name] for name in numeric) for settings in points}
    has_numbers = all(type(value) in (int, float) for place in places for value in place)
    passes = [
        method.fixed_options.get("max_passes")
        for method in methods.values()
        if method.method == "parallel-cascade"
    ]
    others = [name for name in varied if name not in PERTURBATION]
    groups = {tuple(settings[name] for name in others) for settings in points}
    usual = [
        tuple(settings[name] for name in others)
        for settings in points
        if settings["perturbation"] == "prbs" and settings["switching_interval"] == 0.1
    ]
    searches_delay = any(
        method.method == "riv" and method.fixed_options.get("delay", 0.0) is None
        for method in methods.values()
    )
    needs: dict[str, tuple[object, str]] = {
        "trials": (
            keep == "everything",
            f"trials on disk, which keep: {keep} leaves out: set keep: everything",
        ),
        "estimates": (
            keep != "scores",
            "estimates on disk, which keep: scores leaves out: keep estimates",
        ),
        "a setting": (varied, "a setting that differs between the points"),
        "one setting": (
            len(varied) == 1,
            f"one setting that differs between the points, got {names}",
        ),
        "settings": (
            not options,
            f"points that differ in settings of the simulation alone, got {', '.join(options)}",
        ),
        "one abscissa": (
            len({place[:1] for place in places}) == len(places),
            f"one setting beside closed_loop, or several that change with it, got combinations of {names}",
        ),
        "numbers": (
            numeric and has_numbers,
            f"settings that differ, beside closed_loop, with numbers as values, got {names}",
        ),
        "truths": (
            not study.settings.against,
            "scores against the true torques: leave out against: measured",
        ),
        "shared truths": (
            TRUTHS.isdisjoint(varied),
            f"points with the same stiffness, viscosity, inertia and reflex gain, got {names}",
        ),
        "real-time": (
            algorithms == ["real-time"],
            f"one method, real-time, got {listed}",
        ),
        "riv": (algorithms == ["riv"], f"one method, riv, got {listed}"),
        "cascade": (
            any(count != 1 for count in passes),
            "a method parallel-cascade of more than one pass (max_passes)",
        ),
        "cascades": (
            len(passes) == len(methods),
            f"methods parallel-cascade alone, got {listed}",
        ),
        "table 1": (
            set(methods) == {"pr-moesp", "eiv-moesp", "parallel-cascade"},
            "three methods with the names pr-moesp, eiv-moesp and parallel-cascade",
        ),
        "delay": (
            searches_delay,
            "a method riv with the option delay: null, whose delay has an interval",
        ),
        "select": (all(method.select for method in methods.values()), "select for every method"),
        "variation": (
            all(settings["variation"] for settings in points),
            "variation (of K, B and G) at every point",
        ),
        "trajectories": ("riv-tv" in algorithms, "a method riv-tv, for its trajectories"),
        "bound": (
            not any(settings[name] for settings in points for name in NO_BOUND),
            f"a Cramér-Rao bound at every point: {', '.join(NO_BOUND)} must be 0 or null",
        ),
        "trajectory bound": (
            all(
                not settings["reflex_threshold"]
                and (settings["snr_db"] is not None or settings["voluntary"])
                for settings in points
                if settings["variation_shape"] != "square"
            ),
            "a bound of the trajectories at every point: set reflex_threshold: 0, and snr_db or voluntary",
        ),
        "complete point": (
            any(point["antialias_cutoff"] and not point.get("omitted_step") for point in points),
            "a point with all steps of the processing: antialias_cutoff, and omitted_step: null",
        ),
        "usual perturbation": (
            Counter(usual) == Counter(groups),
            "one point with the usual perturbation, prbs with switching_interval: 0.1, in each setting",
        ),
    }
    return {name: words for name, (has_it, words) in needs.items() if not has_it}
