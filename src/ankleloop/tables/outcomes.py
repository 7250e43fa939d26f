"""Trials of a study: their true values, their conditions in words, and why some of them failed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.quantities import POINT, SETTINGS
from ankleloop.tables.means import list_faults

RATE = 100.0  # Hz, of the identification by default
MOST_REASONS = 5  # of failures that a sentence each is about
NUMBER = r"\d[\d.]*(?:e[+-]?\d+)?"  # in a reason
Settings = Mapping[str, Any]  # of the simulation, by name
Points = Mapping[str, Settings]  # of a study, by name
Labels = Mapping[str, str]  # of methods, by name

CONDITIONS: dict[str, dict[Any, str]] = {
    "closed_loop": {True: "closed loop", False: "open loop"},
    "perturbation": {"prbs": "PRBS", "pulses": "decorrelating pulses", "dwells": "random dwells"},
}


def true_values(settings: Settings, names: Iterable[str] = tuple(SETTINGS)) -> dict[str, float]:
    """True values of the parameters that are estimated from simulated trials."""
    return {name: settings[SETTINGS[name]] for name in names}


def true_spectral_radius(settings: Settings, rate: float = RATE) -> float:
    """Magnitude of the largest pole of the simulated reflex low-pass at the rate of the identification [Hz]."""
    omega_n = settings["omega_n"]
    poles = np.roots([1.0, 2.0 * settings["zeta"] * omega_n, omega_n**2])
    decays = list(poles.real)
    if settings.get("pole"):
        decays.append(-settings["pole"])
    return float(np.exp(max(decays) / rate))


def describe_condition(name: str, value: Any) -> str:
    """Experimental condition in words."""
    name = name.removeprefix(POINT)
    return CONDITIONS.get(name, {}).get(value, f"{name} {value}")


def describe_failures(parameters: pd.DataFrame) -> str:
    """Say how many identifications failed, and why; means leave them out."""
    rows = parameters.reindex(columns=["point", "method", "failure"])
    failed = rows.dropna(subset="failure").astype(str)
    if failed.empty:
        return ""
    reasons = failed["failure"].str.replace(NUMBER, "#", regex=True)
    groups = failed.groupby(reasons, sort=False)
    examples = groups.first().assign(count=groups.size())
    examples = examples.sort_values("count", ascending=False, kind="stable")
    texts = [f"{len(failed):,} of {len(parameters):,} identifications failed; means leave them out"]
    for row in examples.head(MOST_REASONS).itertuples():
        reason = row.failure.rstrip(".")
        texts.append(f"{row.count:,} of them, such as {row.method} at {row.point}: {reason}")
    return ". ".join(texts)


def describe_faults(parameters: pd.DataFrame, labels: Labels) -> str:
    """How many identifications failed, and how many estimates came with a warning, for each method that has any."""
    counts = list_faults(parameters).groupby(parameters["method"], sort=False).sum()
    texts = []
    for name, words in (("failures", "without an estimate"), ("warnings", "with a warning")):
        methods = counts.loc[counts[name] > 0, name]
        text = f"{words}: {methods.sum()} of {len(parameters)}"
        if not methods.empty:
            parts = [f"{labels.get(method, method)} {count}" for method, count in methods.items()]
            text += f" ({', '.join(parts)})"
        texts.append(text)
    rings = " In figures they have rings." if counts.to_numpy().any() else ""
    return f"Identifications {'; '.join(texts)}.{rings}"
