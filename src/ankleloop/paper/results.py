"""Results of a study: joining them, summaries over trials, and their words and numbers in tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.paper.trial_counts import count_outcomes

RATE = 100.0  # Hz, of the identification by default

KEYS = ["point", "method", "trial"]  # of an estimate
# Simulation setting that is the true value of each estimated parameter.
SETTINGS = {"K": "stiffness", "B": "viscosity", "I": "inertia", "G": "reflex_gain"}
SETTINGS |= {name: name for name in ("omega_n", "zeta", "delay")}
CONDITIONS: dict[str, dict[Any, str]] = {
    "closed_loop": {True: "closed loop", False: "open loop"},
    "perturbation": {"prbs": "PRBS", "pulses": "decorrelating pulses", "dwells": "random dwells"},
}


def join_scores(parameters: pd.DataFrame, scores: pd.DataFrame) -> pd.DataFrame:
    """Put the VAFs of each estimate beside its parameters."""
    columns = "vaf_" + scores["torque"] + "_" + scores["against"]
    vaf = scores.assign(column=columns).pivot_table("vaf", KEYS, "column").rename_axis(columns=None)
    return parameters.merge(vaf.reset_index(), how="left", on=KEYS)


def summarise_columns(
    table: pd.DataFrame,
    by: Sequence[str],
    names: Sequence[str],
    statistics: Sequence[str] = ("mean", "std", "count"),
) -> pd.DataFrame:
    """Summarise columns over trials."""
    summary = table.groupby(list(by), sort=False)[list(names)].agg(list(statistics))
    summary.columns = pd.Index([f"{name}_{statistic}" for name, statistic in summary.columns])
    return summary.reset_index().merge(count_outcomes(table, by), how="left", on=list(by))


def true_values(settings: Mapping[str, Any], names: Iterable[str] = tuple(SETTINGS)) -> dict[str, float]:
    """True values of the parameters that are estimated from simulated trials."""
    return {name: settings[SETTINGS[name]] for name in names}


def true_spectral_radius(settings: Mapping[str, Any], rate: float = RATE) -> float:
    """Magnitude of the largest pole of the simulated reflex low-pass at the rate of the identification [Hz]."""
    poles = np.roots([1.0, 2.0 * settings["zeta"] * settings["omega_n"], settings["omega_n"] ** 2])
    slowest = max([*poles.real, -settings["pole"]] if settings.get("pole") else poles.real)
    return float(np.exp(slowest / rate))


def describe_condition(name: str, value: Any) -> str:
    """Experimental condition in words."""
    return CONDITIONS.get(name, {}).get(value, f"{name} {value}")


class _Number(float):
    """A number whose text is a dash if it does not exist."""

    def __format__(self, spec: str) -> str:
        return "–" if np.isnan(self) else super().__format__(spec)


def format_pairs(first: Iterable[float], second: Iterable[float], template: str = "{:.1f} ± {:.1f}") -> list[str]:
    """Pairs of numbers as text, such as means with standard deviations, or the ends of intervals."""
    pairs = zip(map(_Number, first), map(_Number, second), strict=True)
    return [f"{pair[0]}" if np.isnan(pair[0]) else template.format(*pair) for pair in pairs]


def format_columns(table: pd.DataFrame, names: Iterable[str], template: str) -> pd.DataFrame:
    """Columns of numbers as text."""
    return table.assign(**{name: [template.format(_Number(value)) for value in table[name]] for name in names})
