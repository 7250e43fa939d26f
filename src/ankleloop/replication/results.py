"""Results of a study: reading them, joining them, summaries over trials, and their words and numbers in tables."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.errors import DataError
from ankleloop.replication.trial_counts import count_outcomes

__all__ = [
    "KEYS",
    "describe_condition",
    "format_columns",
    "format_pairs",
    "join_scores",
    "read_results",
    "summarise_columns",
    "true_spectral_radius",
    "true_values",
]

RATE = 100.0  # Hz, of the identification

KEYS = ["point", "method", "trial"]  # of an estimate
TEXTS = ("recording", "subject", "condition", "trial")  # of tables of recordings
# Simulation setting that is the true value of each estimated parameter.
SETTINGS = {"K": "stiffness", "B": "viscosity", "I": "inertia", "G": "reflex_gain"}
SETTINGS |= {name: name for name in ("omega_n", "zeta", "delay")}
CONDITIONS: dict[str, dict[Any, str]] = {
    "closed_loop": {True: "closed loop", False: "open loop"},
    "perturbation": {"prbs": "PRBS", "pulses": "decorrelating pulses"},
}


def read_results(paths: Iterable[str | os.PathLike[str]]) -> pd.DataFrame:
    """Read tables of scores or parameters, one below the other.

    Parameters
    ----------
    paths : iterable of path-like
        CSV files, one for each chunk of points.

    Returns
    -------
    pandas.DataFrame
        Their rows, numbered from 0. Names of recordings, subjects, conditions and trials of a laboratory are text, as
        they were written: 007 and NA, too.

    Raises
    ------
    DataError
        If a file is missing, or damaged: cut off in a row. Missing rows are seen by
        `ankleloop.replication.completeness.check_study`.
    """
    tables = [_read_table(path) for path in paths]
    return pd.concat([table for table in tables if len(table)] or tables, ignore_index=True)


def _read_table(path: str | os.PathLike[str]) -> pd.DataFrame:
    try:
        text = Path(path).read_bytes().decode("utf-8")
        damage = _find_damage(text)
        table = pd.DataFrame() if damage else pd.read_csv(io.StringIO(text, newline=""), low_memory=False)
    except (OSError, ValueError, csv.Error) as error:
        damage = str(error)
    if damage:
        raise DataError(f"{path}: the table is damaged ({damage}): delete it, and run again: it is made anew.")
    if "recording" in table:
        texts = pd.read_csv(io.StringIO(text, newline=""), dtype=str, keep_default_na=False)
        texts = texts.where(texts != "")
        table = table.assign(**{name: texts[name] for name in TEXTS if name in table})
    return table


def _find_damage(text: str) -> str:
    """What a CSV file that is cut off in a row lacks; of a whole file nothing."""
    if not text.endswith("\n"):
        return "it has no end"
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    columns = len(next(reader))
    for row in reader:
        if len(row) != columns:
            return f"line {reader.line_num} has {len(row)} of {columns} cells"
    return ""


def join_scores(parameters: pd.DataFrame, scores: pd.DataFrame) -> pd.DataFrame:
    """Put the VAFs of each estimate beside its parameters.

    Parameters
    ----------
    parameters : pandas.DataFrame
        One row for each estimate: columns `point`, `method`, `trial`, and the parameters.
    scores : pandas.DataFrame
        One row for each score: columns `point`, `method`, `trial`, `torque`, `against`, `vaf`.

    Returns
    -------
    pandas.DataFrame
        `parameters`, with a column `vaf_{torque}_{against}` for each score; empty for an identification that failed.

    Examples
    --------
    >>> key = {"point": "only", "method": "riv", "trial": [0, 1]}
    >>> scores = pd.DataFrame(key | {"torque": "net", "against": "true", "vaf": [98.0, 97.0]})
    >>> join_scores(pd.DataFrame(key | {"K": [150.0, 149.0]}), scores)["vaf_net_true"].tolist()
    [98.0, 97.0]
    """
    columns = "vaf_" + scores["torque"] + "_" + scores["against"]
    vaf = scores.assign(column=columns).pivot_table("vaf", KEYS, "column").rename_axis(columns=None)
    return parameters.merge(vaf.reset_index(), how="left", on=KEYS)


def summarise_columns(
    table: pd.DataFrame,
    by: Sequence[str],
    names: Sequence[str],
    statistics: Sequence[str] = ("mean", "std", "count"),
) -> pd.DataFrame:
    """Summarise columns over trials.

    Parameters
    ----------
    table : pandas.DataFrame
        One row for each estimate.
    by : sequence of str
        Columns whose values make a row of the summary, in the order of their first appearance.
    names : sequence of str
        Columns to be summarised.
    statistics : sequence of str
        Statistics as pandas names them.

    Returns
    -------
    pandas.DataFrame
        Columns `by`, `{name}_{statistic}` for each name and statistic, and those of
        `ankleloop.replication.trial_counts.count_outcomes`.

    Examples
    --------
    >>> table = pd.DataFrame({"method": "riv", "trial": [0, 1], "K": [150.0, 152.0]})
    >>> summarise_columns(table, ["method"], ["K"], ["mean", "count"]).to_dict("records")
    [{'method': 'riv', 'K_mean': 151.0, 'K_count': 2, 'trials': 2, 'failures': 0, 'warnings': 0}]
    """
    summary = table.groupby(list(by), sort=False)[list(names)].agg(list(statistics))
    summary.columns = pd.Index([f"{name}_{statistic}" for name, statistic in summary.columns])
    return summary.reset_index().merge(count_outcomes(table, by), how="left", on=list(by))


def true_values(settings: Mapping[str, Any], names: Iterable[str] = tuple(SETTINGS)) -> dict[str, float]:
    """True values of the parameters that are estimated from simulated trials.

    Parameters
    ----------
    settings : dict
        Simulation settings by name.
    names : iterable of str
        Parameters; all of them by default.

    Returns
    -------
    dict of str to float

    Examples
    --------
    >>> true_values({"stiffness": 150.0, "viscosity": 0.8}, ["K", "B"])
    {'K': 150.0, 'B': 0.8}
    """
    return {name: settings[SETTINGS[name]] for name in names}


def true_spectral_radius(settings: Mapping[str, Any]) -> float:
    """Magnitude of the largest pole of the simulated reflex low-pass at the rate of the identification.

    Parameters
    ----------
    settings : dict
        Simulation settings by name.

    Returns
    -------
    float

    Examples
    --------
    >>> round(true_spectral_radius({"omega_n": 40.0, "zeta": 0.5}), 4)
    0.8187
    """
    poles = np.roots([1.0, 2.0 * settings["zeta"] * settings["omega_n"], settings["omega_n"] ** 2])
    slowest = max([*poles.real, -settings["pole"]] if settings.get("pole") else poles.real)
    return float(np.exp(slowest / RATE))


def describe_condition(name: str, value: Any) -> str:
    """Experimental condition in words.

    Parameters
    ----------
    name : str
        Simulation setting.
    value : object
        Its value.

    Returns
    -------
    str

    Examples
    --------
    >>> describe_condition("closed_loop", False), describe_condition("zeta", 0.8)
    ('open loop', 'zeta 0.8')
    """
    return CONDITIONS.get(name, {}).get(value, f"{name} {value}")


class _Number(float):
    """A number whose text is a dash if it does not exist."""

    def __format__(self, spec: str) -> str:
        return "–" if np.isnan(self) else super().__format__(spec)


def format_pairs(first: Iterable[float], second: Iterable[float], template: str = "{:.1f} ± {:.1f}") -> list[str]:
    """Pairs of numbers as text, such as means with standard deviations, or the ends of intervals.

    Parameters
    ----------
    first, second : iterable of float
        The numbers.
    template : str
        Format of a pair; a dash stands for a number that does not exist, such as the spread of a single trial.

    Returns
    -------
    list of str

    Examples
    --------
    >>> format_pairs([150.0, 149.0], [2.25, np.nan])
    ['150.0 ± 2.2', '149.0 ± –']
    """
    return [template.format(*map(_Number, pair)) for pair in zip(first, second, strict=True)]


def format_columns(table: pd.DataFrame, names: Iterable[str], template: str) -> pd.DataFrame:
    """Columns of numbers as text.

    Parameters
    ----------
    table : pandas.DataFrame
        The table.
    names : iterable of str
        Columns.
    template : str
        Format of a number; a dash stands for one that does not exist.

    Returns
    -------
    pandas.DataFrame
        The table with text in these columns.

    Examples
    --------
    >>> format_columns(pd.DataFrame({"K": [150.25]}), ["K"], "{:.1f}")["K"].tolist()
    ['150.2']
    """
    return table.assign(**{name: [template.format(_Number(value)) for value in table[name]] for name in names})
