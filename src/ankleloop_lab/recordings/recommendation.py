"""The conclusion of the analysis of a recording, in sentences: which method to take, and whether the joint changes."""

from __future__ import annotations

from itertools import permutations
from typing import Any, NamedTuple

import pandas as pd

from ankleloop.methods.registry import METHODS
from ankleloop.quantities import QUANTITIES
from ankleloop_lab.recordings.analysis import Analysis, compare_unseen

# Of `Analysis.table`; those that no method of a recording has are missing there.
METHOD_COLUMNS = (
    "label",
    "method",
    "vaf_unseen",
    "remarks",
    "unseen_warnings",
    "caution",
    "variation_p",
    "incomplete",
)
PARAMETERS = ("vaf_unseen", "K", "B", "I", "G")  # of a table of several estimates
DEVICE = "apparatus"  # method for a device without a subject
NO_TEXT = ("", float("nan"))  # cells without a text
VARIATION_LEVEL = 0.05  # of the test whether anything varies
CHANGES = {
    "phase": "with the phase of the cycle",
    "time": "with time",
    "schedule": "with the scheduling variable",
}
INCOMPLETE = (
    "But the model is not complete, or the record has a fault, and what a model leaves out may be taken for a change. "
    "So the test decides nothing here. "
)
Choice = tuple[pd.Series, str]  # row of a method, and why it is taken


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
        From `ankleloop_lab.recordings.analysis.analyse`.

    Returns
    -------
    Recommendation

    Examples
    --------
    >>> from ankleloop_lab.recordings.analysis import analyse
    >>> from ankleloop.simulation.simulate import simulate
    >>> recommendation = recommend(analyse(simulate(seed=1), {"RIV": {"method": "riv"}}))
    >>> print(recommendation.text.split(".")[0])
    take RIV: the loop is closed, and torque that is fed back does not bias it
    """
    check = analysis.check
    columns = analysis.table.columns.union(METHOD_COLUMNS, sort=False)
    table = analysis.table.reindex(columns=columns)
    valid = table[table["valid"]]
    trusted = table[table["trusted"]]
    # The fit to the first half has no warning either, and a score of the second.
    scored = trusted["vaf_unseen"].notna() & trusted["unseen_warnings"].isin(NO_TEXT)
    comparable = trusted if check.instrumental else trusted[scored]
    if comparable.empty:
        return Recommendation(None, _explain_nothing(check.verdict, valid, trusted))
    if check.instrumental:
        row, reason = _choose_by_reference(check.loop, trusted, valid)
    else:
        row, reason = _choose_by_vaf(analysis, comparable)
    choice = f"take {row['label']}: {reason}"
    if check.loop == "undecided" and not check.reference:
        choice = f"If the loop was open: {choice}"
    result = describe_result(row)
    kind = f"{row['intervals']} 95 % interval" if "…" in result else "without an interval"
    texts = [choice, f"{result}, {kind}", *_reservations(row, valid)]
    left_out = ", ".join(valid["label"].drop(comparable.index))
    if left_out:
        texts.append(
            f"Left out because of a warning, or without a score of the unseen half: {left_out}"
        )
    return Recommendation(row["label"], " ".join(f"{text}." for text in texts))


def describe_result(row: pd.Series) -> str:
    """What an estimate is about in a sentence: K of a joint, or inertia and friction of a device."""
    names = ("I", "friction") if row["method"] == DEVICE else ("K",)
    values = [
        f"{name} = {format_with_interval(row, name)} {QUANTITIES[name].unit}" for name in names
    ]
    return ", ".join(values)


def _explain_nothing(verdict: str, valid: pd.DataFrame, trusted: pd.DataFrame) -> str:
    """Why no method is recommended: there is no estimate, or none without a warning."""
    if valid.empty:
        reason = "it was refused" if verdict == "refused" else "no method is valid for it"
        return f"Nothing can be concluded from this recording: {reason}."
    reason = "none without a warning could be scored on the half that was not fitted"
    if trusted.empty:
        reason = (
            f"every method that was fitted has a warning ({', '.join(valid['label'])}), so a parameter may be off by "
            "more than the tolerance. The warnings say which, and what to do"
        )
    return f"No method is recommended: {reason}."


def _choose_by_reference(loop: str, trusted: pd.DataFrame, valid: pd.DataFrame) -> Choice:
    """The preferred method among those that rest on the reference, and the reason."""
    changing = _select_changing(trusted)
    row = _prefer(trusted)
    if not changing.empty:
        row = changing.iloc[0]
        reason = "torque that is fed back does not bias it, and its test says that K, B or G change"
    elif row["method"] == DEVICE:
        reason = (
            "torque that is fed back does not bias it, and it is for a device without a subject"
        )
    elif row["method"] == "riv":
        reason = "and torque that is fed back does not bias it"
    else:
        riv = "riv has a warning" if valid["method"].eq("riv").any() else "there is no valid riv"
        reason = f"{riv}, and of the others this is the first in the order of preference"
    feedback = "the loop is closed" if loop == "closed" else "feedback is not excluded"
    return row, f"{feedback}, {reason}"


def _choose_by_vaf(analysis: Analysis, comparable: pd.DataFrame) -> Choice:
    """The method that explains most of the unseen half, or the preferred one of those that cannot be told from it."""
    unseen = analysis.unseen
    better: dict[str, list[str]] = {label: [] for label in comparable["label"]}
    for label, other in permutations(better, 2):
        gain = compare_unseen(unseen[label], unseen[other])
        if gain and gain.low > 0:
            better[label].append(other)
    beaten = {other for others in better.values() for other in others}
    row = _prefer(comparable[~comparable["label"].isin(beaten)])
    score = f"{row['vaf_unseen']:.1f} % of the half that was not fitted"
    rivals = [label for label in better if label not in (row["label"], *better[row["label"]])]
    if rivals:
        order = "the order of preference (riv, the MOESP family, the parallel cascade)"
        reason = f"of the methods that the data do not tell apart it comes first in {order}"
        return row, f"{reason}. It explains {score}; the others there: {', '.join(rivals)}"
    if len(better) == 1:
        return row, f"it is the only one that could be scored without a warning ({score})"
    return row, f"it explains most ({score}), with a confidence of 95 %"


def _prefer(rows: pd.DataFrame) -> pd.Series:
    """The method with the fewest parameters, without a caution if there is one; of equal ones the first.

    Methods that other packages register come last.
    """
    ranks = {name: rank for rank, name in enumerate(METHODS)}
    order = rows["method"].map(ranks).fillna(len(ranks))
    order[~rows["caution"].isin(NO_TEXT)] += len(ranks) + 1
    return rows.loc[order.idxmin()]


def _reservations(row: pd.Series, valid: pd.DataFrame) -> list[str]:
    """What speaks against too much trust in a method: change of the joint, caution, an incomplete model."""
    texts = []
    if row["remarks"] and pd.notna(row["remarks"]):
        texts.append(f"Remarked: {row['remarks'].rstrip('.')}")
    changing = list(_select_changing(valid)["label"])
    if row["label"] in changing:
        texts.append("This is the mean over the recording; the trajectories show the change")
    elif changing:
        texts.append(
            f"Its parameters are constant, and the test of {changing[0]} says that they change"
        )
    if row["caution"] and pd.notna(row["caution"]):
        texts.append(f"Caution: {row['caution'].rstrip('.')}")
    if row.get("residual_related") == 1:
        texts.append("Its residual still depends on the movement, so its model is not complete")
    return texts


def _select_changing(rows: pd.DataFrame) -> pd.DataFrame:
    """Methods whose parameters may change, and whose test says that they do; of an incomplete model it says nothing."""
    return rows[(rows["variation_p"] < VARIATION_LEVEL) & rows["incomplete"].ne(True)]


def format_with_interval(row: pd.Series, name: str) -> str:
    """Value of a row with its 95 % interval where there is one."""
    value, low, high = (row.get(column) for column in (name, f"{name}_low", f"{name}_high"))
    if isinstance(value, str):
        return value
    if pd.isna(value):
        return "–"
    return f"{value:.4g}" if pd.isna(low) else f"{value:.4g} ({low:.4g} … {high:.4g})"


def format_parameters(table: pd.DataFrame) -> pd.DataFrame:
    """Score and parameters of estimates with their intervals: a row for each row of a table, with its index."""
    rows = [row for _, row in table.iterrows()]
    names = [*PARAMETERS, "friction"] if "friction" in table else PARAMETERS  # of an apparatus
    cells = {
        QUANTITIES[name].label: [format_with_interval(row, name) for row in rows] for name in names
    }
    return pd.DataFrame(cells, index=table.index)


def describe_variations(analysis: Analysis) -> dict[str, str]:
    """Whether the joint of a recording changes, in sentences, by the label of each method whose parameters may."""
    rows = {row.get("label"): row for row in analysis.table.to_dict("records")}
    texts = {}
    for label, estimate in analysis.estimates.items():
        probabilities = estimate.diagnostics.get("variation_p")
        if estimate.trajectories is None or not probabilities:  # nothing in it can vary
            continue
        dimension = str(next(iter(estimate.trajectories.sizes)))
        words = CHANGES[dimension]
        data = "unseen cycles" if dimension == "phase" else "the unseen half"
        shown = {
            name: "less than 0.001" if p < 0.001 else f"{p:.2g}"
            for name, p in probabilities.items()
        }
        all_p = shown.pop("all")
        each = ", ".join(f"{name} {p}" for name, p in shown.items())
        change = f"No change of K, B or G {words} is shown"
        doubt = "A change that is smaller than the bands may be there. "
        if probabilities["all"] < VARIATION_LEVEL:
            change = f"K, B or G change {words}"
            doubt = INCOMPLETE if rows[label]["incomplete"] else ""
        texts[label] = (
            f"{change}: a constant joint gives as large a variation with a probability of {all_p} "
            f"(level {100 * VARIATION_LEVEL:g} %). Each of them alone, while the others may change: {each}. "
            f"{doubt}{_compare_with_constant(analysis, rows, label, data)}"
        )
    return texts


def _compare_with_constant(analysis: Analysis, rows: dict[str, Any], label: str, data: str) -> str:
    """VAF of unseen data beside that of a time-invariant fit."""
    score = rows[label]["vaf_unseen"]
    if pd.isna(score):
        reason = rows[label]["unseen_warnings"].removeprefix("there is none: ")
        return f"There is no VAF of {data}: {reason}"
    text = f"Of the torque of {data} the trajectories explain {score:.1f} %"
    for constant, torques in analysis.unseen.items():
        if rows[constant]["method"] != "riv":
            continue
        text += f", the time-invariant fit ({constant}) {rows[constant]['vaf_unseen']:.1f} %"
        gain = compare_unseen(analysis.unseen[label], torques)
        if gain:
            text += f": a difference of {gain.difference:.1f} points (95 %: {gain.low:.1f} … {gain.high:.1f})"
    return f"{text}."
