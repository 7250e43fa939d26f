"""Which method to take for a recording: the conclusion of its analysis, in one sentence."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from ankleloop.quantities import QUANTITIES
from ankleloop.recordings.analysis import Analysis

__all__ = ["Recommendation", "format_with_interval", "recommend", "select_valid_methods"]

NO_CONCLUSION = "Nothing can be concluded from this recording."


@dataclass(frozen=True)
class Recommendation:
    """The method to take for a recording.

    Parameters
    ----------
    label : str or None
        Label of the method; None if no method can be recommended.
    reason : str
        Why this one; without a method, why there is none.
    condition : str
        Condition under which the recommendation holds; empty if there is none.
    text : str
        All of it in one sentence, with the stiffness.
    """

    label: str | None
    reason: str
    condition: str
    text: str


def recommend(analysis: Analysis) -> Recommendation:
    """Recommend one of the methods that were fitted to a recording.

    In closed loop this is `riv` where it was fitted: torque that is fed back does not bias it. In open loop it is the
    method with the largest VAF of the half that was not fitted.

    Parameters
    ----------
    analysis : Analysis
        From `ankleloop.recordings.analysis.analyse`.

    Returns
    -------
    Recommendation

    Examples
    --------
    >>> from ankleloop.recordings.analysis import analyse
    >>> from ankleloop.simulation.simulate import simulate
    >>> recommendation = recommend(analyse(simulate(seed=1), {"RIV": {"method": "riv"}}))
    >>> recommendation.label, recommendation.reason
    ('RIV', 'the loop is closed, and torque that is fed back does not bias it')
    """
    valid = select_valid_methods(analysis.table)
    if valid.empty:
        return Recommendation(None, "no method was fitted", "", NO_CONCLUSION)
    if analysis.check.loop == "closed":
        riv = valid[valid["method"] == "riv"]
        best = valid.iloc[0] if riv.empty else riv.iloc[0]
        reason = "the loop is closed, and torque that is fed back does not bias it"
    elif valid["vaf_unseen"].isna().all():
        return Recommendation(None, "no method could be scored on the half that was not fitted", "", NO_CONCLUSION)
    else:
        best = valid.loc[valid["vaf_unseen"].idxmax()]
        reason = f"it explains most of the half that was not fitted ({best['vaf_unseen']:.1f} %)"
    condition = "If the loop was open" if analysis.check.loop == "undecided" else ""
    stiffness = f"K = {format_with_interval(best, 'K')} {QUANTITIES['K'].unit}"
    sentence = f"take {best['label']}: {reason}. {stiffness}."
    return Recommendation(best["label"], reason, condition, f"{condition}: {sentence}" if condition else sentence)


def select_valid_methods(table: pd.DataFrame) -> pd.DataFrame:
    """Rows of the methods that were fitted; none for a recording that was refused.

    Parameters
    ----------
    table : pandas.DataFrame
        `Analysis.table`.

    Returns
    -------
    pandas.DataFrame
        The rows whose method is valid for the recording.
    """
    return table[table["valid"].astype(bool)] if "valid" in table else table.iloc[:0]


def format_with_interval(row: pd.Series, name: str) -> str:
    """Value of a row with its 95 % interval where there is one.

    Parameters
    ----------
    row : pandas.Series
        A row of `Analysis.table`; the interval is in `{name}_low` and `{name}_high`.
    name : str
        Column of the value.

    Returns
    -------
    str
        Text as it is; a number to four digits; a dash where there is no value.

    Examples
    --------
    >>> row = pd.Series({"K": 151.234, "K_low": 149.0, "K_high": 153.0, "B": 0.81234})
    >>> format_with_interval(row, "K"), format_with_interval(row, "B"), format_with_interval(row, "G")
    ('151.2 (149 … 153)', '0.8123', '–')
    """
    value, low, high = row.get(name), row.get(f"{name}_low"), row.get(f"{name}_high")
    if isinstance(value, str) or pd.isna(value):
        return value if isinstance(value, str) else "–"
    interval = "" if pd.isna(low) else f" ({low:.4g} … {high:.4g})"
    return f"{value:.4g}{interval}"
