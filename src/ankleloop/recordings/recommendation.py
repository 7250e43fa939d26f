"""The conclusion of the analysis of a recording, in sentences: which method to take, and whether the joint changes."""

from __future__ import annotations

from typing import Any, NamedTuple

import pandas as pd

from ankleloop.methods.registry import METHODS
from ankleloop.quantities import QUANTITIES
from ankleloop.recordings.analysis import Analysis, compare_unseen

# Of `Analysis.table`; those that no method of a recording has are missing there.
COLUMNS = (
    "label",
    "method",
    "vaf_unseen",
    "unseen_warnings",
    "caution",
    "variation_p",
    "incomplete",
)
NOTHING = ("", float("nan"))  # cells without a text
LEVEL = 0.05  # of the test whether anything varies
CHANGES = {
    "phase": "with the phase of the cycle",
    "time": "with time",
    "schedule": "with the scheduling variable",
}


class Recommendation(NamedTuple):
    """The method to take for a recording."""

    label: str | None  # label of the method; None if no method can be recommended
    text: str  # the method, why this one, its stiffness and what speaks against too much trust, in sentences


def recommend(analysis: Analysis) -> Recommendation:
    """Recommend one of the methods that were fitted to a recording without a warning.

    Where feedback is there or is not excluded, and there is a reference, this is `riv`: torque that is fed back does
    not bias it, and the VAF of unseen data does not count there; or `riv-tv`, where its test says that the parameters
    change. In open loop it is the method with the largest VAF of the
    half that was not fitted. Methods that no other one beats, by the 95 % interval of the paired difference of their
    VAFs, are as good; of these the one with the fewest parameters is taken, `riv` first, which gives their intervals.

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
    >>> print(recommendation.text.split(".")[0])
    take RIV: the loop is closed, and torque that is fed back does not bias it
    """
    check, table = (
        analysis.check,
        analysis.table.reindex(columns=analysis.table.columns.union(COLUMNS, sort=False)),
    )
    valid, trusted = table[table["valid"]], table[table["trusted"]]
    # The fit to the first half has no warning either, and a score of the second.
    scored = trusted["vaf_unseen"].notna() & trusted["unseen_warnings"].isin(NOTHING)
    comparable = trusted if check.instrumental else trusted[scored]
    if comparable.empty:
        reason = "no method without a warning could be scored on the half that was not fitted"
        if valid.empty:
            reason = "it was refused" if check.verdict == "refused" else "no method is valid for it"
        elif trusted.empty:
            reason = f"every method that was fitted has a warning ({', '.join(valid['label'])})"
        return Recommendation(None, f"Nothing can be concluded from this recording: {reason}.")
    if check.instrumental:
        row, reason = _choose_by_reference(check.loop, trusted, valid)
    else:
        row, reason = _choose_by_vaf(analysis, comparable)
    condition = (
        "If the loop was open: " if check.loop == "undecided" and not check.reference else ""
    )
    kind = (
        "without an interval" if pd.isna(row.get("K_low")) else f"{row['intervals']} 95 % interval"
    )
    stiffness = f"K = {format_with_interval(row, 'K')} {QUANTITIES['K'].unit}, {kind}"
    texts = [f"{condition}take {row['label']}: {reason}", stiffness, *_reservations(row, valid)]
    if left_out := ", ".join(valid["label"].drop(comparable.index)):
        texts.append(
            f"Left out because of a warning, or without a score of the unseen half: {left_out}"
        )
    return Recommendation(row["label"], " ".join(f"{text}." for text in texts))


def _choose_by_reference(
    loop: str, trusted: pd.DataFrame, valid: pd.DataFrame
) -> tuple[pd.Series, str]:
    """The preferred method among those that rest on the reference, and the reason."""
    changing = _select_changing(trusted)
    row = changing.iloc[0] if len(changing) else _prefer(trusted)
    if len(changing):
        reason = "torque that is fed back does not bias it, and its test says that K, B or G change"
    elif row["method"] == "riv":
        reason = "and torque that is fed back does not bias it"
    else:
        riv = "riv has a warning" if valid["method"].eq("riv").any() else "there is no valid riv"
        reason = f"{riv}, and of the others this is the first in the order of preference"
    return (
        row,
        f"{'the loop is closed' if loop == 'closed' else 'feedback is not excluded'}, {reason}",
    )


def _choose_by_vaf(analysis: Analysis, comparable: pd.DataFrame) -> tuple[pd.Series, str]:
    """The method that explains most of the unseen half, or the preferred one of those that cannot be told from it."""
    labels, unseen = comparable["label"], analysis.unseen
    gains = {(a, b): compare_unseen(unseen[a], unseen[b]) for a in labels for b in labels if a != b}
    beaten = {worse for (_, worse), gain in gains.items() if gain and gain.low > 0}
    row = _prefer(comparable[~labels.isin(beaten)])
    others = {label: gain for (label, other), gain in gains.items() if other == row["label"]}
    score = f"{row['vaf_unseen']:.1f} % of the half that was not fitted"
    if not others:
        return row, f"it is the only one that could be scored without a warning ({score})"
    unclear = {label: gain for label, gain in others.items() if gain is None or gain.high >= 0}
    if not unclear:
        margin = min(-gain.high for gain in others.values() if gain)
        return row, f"it explains most ({score}), by {margin:.2g} points or more (95 % confidence)"
    ends = [
        f"{gain.low:+.2g} … {gain.high:+.2g} points" if gain else "it is too short"
        for gain in unclear.values()
    ]
    shown = ", ".join(f"{label} ({text})" for label, text in zip(unclear, ends, strict=True))
    order = "the order of preference (riv, the MOESP family, the parallel cascade)"
    reason = f"of the methods that the data do not tell apart it comes first in {order}. It explains {score}"
    return (
        row,
        f"{reason}; the others there, with the 95 % interval of their difference from it: {shown}",
    )


def _prefer(rows: pd.DataFrame) -> pd.Series:
    """The method with the fewest parameters, without a caution if there is one; of equal ones the first.

    Methods that other packages register come last.
    """
    cautious = ~rows["caution"].isin(NOTHING)
    ranks = {name: rank for rank, name in enumerate(METHODS)}
    order = rows["method"].map(ranks).fillna(len(ranks))
    return rows.loc[min(rows.index, key=lambda k: (cautious[k], order[k]))]


def _reservations(row: pd.Series, valid: pd.DataFrame) -> list[str]:
    """What speaks against too much trust in a method: change of the joint, caution, an incomplete model."""
    texts, changing = [], list(_select_changing(valid)["label"])
    if row["label"] in changing:
        texts.append("This is the mean over the recording; the trajectories show the change")
    elif changing:
        texts.append(
            f"Its parameters are constant, and the test of {changing[0]} says that they change"
        )
    if row["caution"] and pd.notna(row["caution"]):
        texts.append(f"Caution: {row['caution'].rstrip('.')}")
    if row.get("residual_related") in (True, 1):
        texts.append("Its residual still depends on the movement, so its model is not complete")
    return texts


def _select_changing(rows: pd.DataFrame) -> pd.DataFrame:
    """Methods whose parameters may change, and whose test says that they do; of an incomplete model it says nothing."""
    return rows[(rows["variation_p"] < LEVEL) & rows["incomplete"].ne(True)]


def format_with_interval(row: pd.Series, name: str) -> str:
    """Value of a row with its 95 % interval where there is one."""
    value, low, high = row.get(name), row.get(f"{name}_low"), row.get(f"{name}_high")
    if isinstance(value, str) or pd.isna(value):
        return value if isinstance(value, str) else "–"
    return f"{value:.4g}" if pd.isna(low) else f"{value:.4g} ({low:.4g} … {high:.4g})"


def describe_variations(analysis: Analysis) -> dict[str, str]:
    """Whether the joint of a recording changes, in sentences, by the label of each method whose parameters may."""
    rows = {row.get("label"): row for row in analysis.table.to_dict("records")}
    texts = {}
    for label, estimate in analysis.estimates.items():
        probabilities = estimate.diagnostics.get("variation_p")
        if estimate.trajectories is None or not probabilities:  # nothing in it can vary
            continue
        dimension = str(next(iter(estimate.trajectories.sizes)))
        words, data = (
            CHANGES[dimension],
            "unseen cycles" if dimension == "phase" else "the unseen half",
        )
        p = {
            name: "less than 0.001" if p < 0.001 else f"{p:.2g}"
            for name, p in probabilities.items()
        }
        each = ", ".join(f"{name} {p[name]}" for name in p if name != "all")
        changes = probabilities["all"] < LEVEL
        text = (
            f"K, B or G change {words}" if changes else f"No change of K, B or G {words} is shown"
        )
        text += f": a constant joint gives as large a variation with a probability of {p['all']} "
        text += (
            f"(level {100 * LEVEL:g} %). Each of them alone, while the others may change: {each}. "
        )
        if not changes:
            text += "A change that is smaller than the bands may be there. "
        elif rows[label]["incomplete"]:
            text += "But the model is not complete, or the record has a fault, and what a model leaves out may be "
            text += "taken for a change. So the test decides nothing here. "
        texts[label] = text + _compare_with_constant(analysis, rows, label, data)
    return texts


def _compare_with_constant(analysis: Analysis, rows: dict[str, Any], label: str, data: str) -> str:
    """VAF of unseen data beside that of a time-invariant fit."""
    row, score = rows[label], rows[label]["vaf_unseen"]
    if pd.isna(score):
        return (
            f"There is no VAF of {data}: {row['unseen_warnings'].removeprefix('there is none: ')}"
        )
    text = f"Of the torque of {data} the trajectories explain {score:.1f} %"
    for constant in (name for name in analysis.unseen if rows[name]["method"] == "riv"):
        text += f", the time-invariant fit ({constant}) {rows[constant]['vaf_unseen']:.1f} %"
        if gain := compare_unseen(analysis.unseen[label], analysis.unseen[constant]):
            text += f": a difference of {gain.difference:.1f} points (95 %: {gain.low:.1f} … {gain.high:.1f})"
    return f"{text}."
