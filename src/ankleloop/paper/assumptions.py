"""What the paper leaves open, what was assumed instead, and why: reasons from results where they are results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from ankleloop.paper.captions import format_setting, label_setting
from ankleloop.paper.comparisons import Tables, format_mean, join_phrases, mean_margin
from ankleloop.paper.judgement import CONDITIONAL, REPRODUCED
from ankleloop.paper.verdicts import phrase_verdict

# Reasons that no result can change: physics, and the words of the paper.
PHYSICS = {
    "actuator_frequency": "a step of the command through an ideal actuator would need infinite torque",
    "actuator_damping": "as above",
    "antialias_cutoff": "the acceleration jumps where the command switches: it has no upper frequency",
}
CHOICES = [
    ("B and D", "least squares", "the paper does not say; the toolbox it used also offers instruments"),
    ("projection of PR-MOESP", "ordinary", "“MOESP with past reference” reads as PI-MOESP with other instruments"),
]
UNKNOWN = "not published; the study that shows its effect was not run"


def explain_assumptions(ledger: pd.DataFrame, tables: Tables, settings: Mapping[str, Any]) -> pd.DataFrame:
    """Assumptions with their reasons."""
    load = _explain_load(ledger, tables)
    reasons = {
        "reflex_gain": _explain_gain(ledger),
        "load_inertia": load,
        "load_viscosity": "as above",
        "load_stiffness": "as above",
        **PHYSICS,
        "voluntary": _explain_voluntary(ledger),
    }
    rows = [(label_setting(name)[0], format_setting(name, settings[name]), reason) for name, reason in reasons.items()]
    rows.append(("stop rule of the parallel cascade", "one pass", _explain_stop_rule(tables, settings)))
    return pd.DataFrame([*rows, *CHOICES], columns=["parameter", "value", "why"])


def _explain_gain(ledger: pd.DataFrame) -> str:
    """Verdict on the gain of Eq. 17 as printed."""
    rows = ledger[ledger["id"] == "eq17-gain"].dropna(subset="ours")
    if rows.empty:
        return UNKNOWN
    claim = rows.iloc[0]
    return f"that it is the gain of Eq. 17 as printed {phrase_verdict(claim)}: {claim['reason'].rstrip('.')}"


def _explain_load(ledger: pd.DataFrame, tables: Tables) -> str:
    """Gains at which the loop is stable, and the numbers of Table 1 that this load gives."""
    texts = []
    if "figure4" in tables:  # an unstable loop would have stopped the run
        gains = tables["figure4"]["reflex_gain"]
        texts.append(f"the loop is stable at all gains of Figure 4 ({gains.min():g} … {gains.max():g})")
    rows = ledger[ledger["id"].str.startswith("table1/")].dropna(subset=["ours", "paper"])
    if len(rows):
        count = rows["verdict"].isin([REPRODUCED, CONDITIONAL]).sum()
        texts.append(f"{count} of the {len(rows)} numbers of Table 1 are reproduced with it")
    return "; ".join(texts) or UNKNOWN


def _explain_voluntary(ledger: pd.DataFrame) -> str:
    """Net VAF of PR-MOESP with it, beside the published one."""
    rows = ledger[ledger["id"] == "table1/pr-moesp/net"].dropna(subset="ours")
    if rows.empty:
        return UNKNOWN
    number = rows.iloc[0]
    ours = format_mean(number["ours"], number["uncertainty"])
    return f"with it the net VAF of PR-MOESP is {ours} %, published are {number['paper']:g} %"


def _explain_stop_rule(tables: Tables, settings: Mapping[str, Any]) -> str:
    """Intrinsic VAF of Table 1 by both stop rules, beside the published one."""
    if "table1" not in tables:
        return UNKNOWN
    table = tables["table1"]
    rows = table[(table["gain"] == settings["reflex_gain"]) & (table["torque"] == "intrinsic")].set_index("method")
    methods = {"parallel-cascade-one-pass": "after one pass", "parallel-cascade": "at convergence"}
    if not set(methods) <= set(rows.index):
        return UNKNOWN
    margins = pd.Series(mean_margin(rows["sd"], rows["n"]), rows.index)
    texts = [f"{format_mean(rows.loc[name, 'mean'], margins[name])} % {rule}" for name, rule in methods.items()]
    paper = rows.loc["parallel-cascade-one-pass", "paper"]
    return f"the intrinsic VAF of Table 1 is {join_phrases(texts)}, published are {paper:g} %"
