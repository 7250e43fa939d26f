"""The ledger: every verdict comes from a comparison, and follows the results."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ankleloop.replication.claim_checks import CLAIM_CHECKS
from ankleloop.replication.evidence import Mean, StudyResults
from ankleloop.replication.ledger import VERDICTS, format_ledger, verify

PUBLISHED = Path(__file__).parents[3] / "data" / "published"
CLAIMS = pd.read_csv(PUBLISHED / "claims.csv")
TABLES = {name: pd.read_csv(PUBLISHED / f"{name}.csv") for name in ("table1", "table2")}
MEASUREMENTS = {
    "block_rows": 15,
    "constant_rows": 15,
    "constant_directions": 0,
    "correlation_rows": 122,
    "free_b_net_vaf": 0.02,
    "pr-moesp_instrument_rows": 15,
    "eiv-moesp_instrument_rows": 135,
    "pr-moesp_milliseconds": 20.0,
    "eiv-moesp_milliseconds": 40.0,
    "pr-moesp_megabytes": 7.0,
    "eiv-moesp_megabytes": 13.0,
}


def make_study(points, vaf, k=None, kind="simulation", trials=10, spread=0.1, passes=1.0):
    """Results with chosen means: `vaf` by (point, method, torque, against), `k` by (point, method)."""
    deviation = spread * np.resize([-1.0, 1.0], trials)
    scores = [
        {"point": p, "method": m, "trial": t, "torque": torque, "against": against, "vaf": mean + deviation[t]}
        for (p, m, torque, against), mean in vaf.items()
        for t in range(trials)
    ]
    parameters = [
        {"point": p, "method": m, "trial": t, "K": mean + deviation[t], "passes": passes}
        for (p, m), mean in (k or {}).items()
        for t in range(trials)
    ]
    points = {name: {"stiffness": 150.0, **settings} for name, settings in points.items()}
    return StudyResults(kind, points, pd.DataFrame(scores), pd.DataFrame(parameters))


def table1(shift=0.0, spread=0.1):
    """Results that are the published ones, shifted, and a further point with a gain of 2."""
    points = {"reflex_gain=13.0": {"reflex_gain": 13.0}, "reflex_gain=2.0": {"reflex_gain": 2.0}}
    vaf = {
        ("reflex_gain=13.0", n.method, n.torque, n.against): n.paper + shift for n in TABLES["table1"].itertuples()
    } | {("reflex_gain=2.0", "parallel-cascade-one-pass", "intrinsic", "true"): 99.0}
    return make_study(points, vaf, {("reflex_gain=13.0", "pr-moesp"): 150.5}, spread=spread)


def voluntary(closed, opened):
    """K of every method in closed loop and in open loop, at half and no voluntary torque."""
    points = {
        f"{level} {loop}": {"voluntary": level, "closed_loop": loop} for level in (0.0, 0.5) for loop in (True, False)
    }
    methods = ("pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp", "parallel-cascade", "real-time")
    k = {(p, m): (closed if settings["closed_loop"] else opened) for p, settings in points.items() for m in methods}
    vaf = {
        (p, "parallel-cascade-one-pass", "intrinsic", "true"): 50.0 if settings["closed_loop"] else 80.0
        for p, settings in points.items()
    }
    return make_study(points, vaf, k)


def figure4(one_pass=(75.0, 0.0, -140.0), converged=99.9):
    points = {f"reflex_gain={gain}": {"reflex_gain": gain} for gain in (10.0, 20.0, 30.0)}
    vaf = {}
    for (point, _), low in zip(points.items(), one_pass, strict=True):
        vaf[point, "parallel-cascade-one-pass", "intrinsic", "true"] = low
        vaf[point, "parallel-cascade", "intrinsic", "true"] = converged
        vaf |= {(point, "pr-moesp", torque, "true"): 98.5 for torque in ("net", "intrinsic", "reflex")}
    k = {(point, "parallel-cascade"): 150.0 for point in points}
    return make_study(points, vaf, k, passes=40.0)


def real_time(pulses=150.0, prbs=180.0):
    points = {
        f"{name} {loop}": {"perturbation": name, "closed_loop": loop} for name in ("pulses", "prbs") for loop in (0, 1)
    }
    k = {(p, "real-time"): pulses if settings["perturbation"] == "pulses" else prbs for p, settings in points.items()}
    points = {name: {**settings, "closed_loop": bool(settings["closed_loop"])} for name, settings in points.items()}
    return make_study(points, {}, k)


def table2(kind):
    vaf = {("only", n.method, n.torque, n.against): n.paper for n in TABLES["table2"].itertuples()}
    return make_study({"only": {}}, vaf, kind=kind)


def build_ledger(measurements=MEASUREMENTS, **studies):
    results = {
        "table1": table1(),
        "table2": table2("simulation"),
        "voluntary": voluntary(closed=120.0, opened=150.0),
        "figure4": figure4(),
        "real-time": real_time(),
    } | studies
    table = pd.DataFrame({"quantity": list(measurements), "value": list(measurements.values())})
    return verify(CLAIMS, TABLES, results, table).set_index("id")


def test_every_number_and_claim_has_a_row_and_a_verdict_with_a_reason():
    table = build_ledger()
    assert set(CLAIMS["id"]) <= set(table.index)
    assert len(table) == len(CLAIMS) + 18
    assert table.index.is_unique
    assert set(table["verdict"]) <= set(VERDICTS)
    assert table["reason"].str.endswith(".").all()
    assert table["how"].notna().all()
    assert not table["reason"].str.contains("nan").any()
    assert set(CLAIMS["check"]) == set(CLAIM_CHECKS)


def test_numbers_of_a_table_follow_the_results():
    rows = [f"table1/{n.method}/{n.torque}" for n in TABLES["table1"].itertuples()]
    assert set(build_ledger().loc[rows, "verdict"]) == {"reproduced under stated conditions"}
    above = build_ledger(table1=table1(shift=2.5)).loc[rows]
    assert set(above["verdict"]) == {"not reproduced"}
    assert above["reason"].str.contains("2.5 points above the paper's .* better than published").all()
    below = build_ledger(table1=table1(shift=-2.5)).loc[rows]
    assert set(below["verdict"]) == {"not reproduced"}
    assert not below["reason"].str.contains("better").any()
    wide = build_ledger(table1=table1(shift=1.0, spread=6.0)).loc[rows]
    assert set(wide["verdict"]) == {"cannot be judged"}
    assert wide["reason"].str.contains("too wide").all()


def test_neither_a_simulated_stand_in_nor_a_table_without_tolerance_has_a_verdict():
    rows = [f"table2/{n.method}/{n.torque}" for n in TABLES["table2"].itertuples()]
    stand_in = build_ledger().loc[rows]
    assert set(stand_in["verdict"]) == {"cannot be judged"}
    assert stand_in["reason"].str.contains("stand-in").all()
    recording = build_ledger(table2=table2("recordings")).loc[rows]
    assert set(recording["verdict"]) == {"cannot be judged"}
    assert recording["reason"].str.endswith("% at only: the table sets no tolerance.").all()


OUTCOMES = [
    ("openloop-biased", {}, "reproduced under stated conditions"),
    ("openloop-biased", {"voluntary": voluntary(closed=151.0, opened=150.0)}, "not reproduced"),
    ("pr-unbiased", {}, "not reproduced"),
    ("pr-unbiased", {"voluntary": voluntary(closed=151.0, opened=150.0)}, "reproduced"),
    ("eiv-unbiased", {}, "not reproduced"),
    ("eiv-unbiased", {"voluntary": voluntary(closed=149.0, opened=150.0)}, "reproduced"),
    ("pr-accurate", {}, "reproduced under stated conditions"),
    ("similar", {}, "reproduced under stated conditions"),
    ("cascade-net-good", {}, "reproduced under stated conditions"),
    ("cascade-net-good", {"table1": table1(shift=-15.0)}, "not reproduced"),
    ("cascade-openloop", {}, "reproduced under stated conditions"),
    ("figure4-pr", {}, "reproduced under stated conditions"),
    ("figure4-cascade-biased", {}, "reproduced under stated conditions"),
    ("figure4-cascade-biased", {"figure4": figure4(one_pass=(99.0, 99.0, 98.0))}, "not reproduced"),
    ("figure4-cascade-falls", {}, "reproduced under stated conditions"),
    ("figure4-cascade-falls", {"figure4": figure4(one_pass=(75.0, 80.0, 90.0))}, "not reproduced"),
    ("figure4-cause", {}, "not reproduced"),
    ("figure4-cause", {"figure4": figure4(converged=60.0)}, "reproduced"),
    ("figure4-count", {}, "not reproduced"),
    ("eq17-gain", {}, "not reproduced"),
    ("eq10-constant", {}, "not reproduced"),
    ("eq10-constant", {"measurements": MEASUREMENTS | {"constant_directions": 15}}, "reproduced"),
    ("eq11-zero", {}, "reproduced under stated conditions"),
    ("eq11-zero", {"measurements": MEASUREMENTS | {"free_b_net_vaf": 3.0}}, "not reproduced"),
    ("columns-eiv", {}, "reproduced under stated conditions"),
    ("columns-pr", {}, "reproduced under stated conditions"),
    ("economy-time", {}, "reproduced under stated conditions"),
    ("economy-time", {"measurements": MEASUREMENTS | {"eiv-moesp_milliseconds": 10.0}}, "not reproduced"),
    ("economy-memory", {}, "reproduced under stated conditions"),
    ("table2-text", {}, "not reproduced"),
    ("real-time-input", {}, "reproduced under stated conditions"),
    ("real-time-input", {"real-time": real_time(pulses=180.0, prbs=180.0)}, "not reproduced"),
]


@pytest.mark.parametrize(("claim", "results", "verdict"), OUTCOMES)
def test_a_verdict_follows_the_results(claim, results, verdict):
    assert build_ledger(**results).loc[claim, "verdict"] == verdict


def test_claims_without_results_cannot_be_judged():
    table = verify(CLAIMS, TABLES, {}, pd.DataFrame({"quantity": [], "value": []})).set_index("id")
    assert table.loc["figure4-pr", "verdict"] == "cannot be judged"
    assert table.loc["figure4-pr", "reason"] == "the study figure4 was not run."
    assert table.loc["economy-time", "reason"] == "pr-moesp_milliseconds was not measured."
    assert np.isnan(table.loc["figure4-pr", "ours"])
    assert set(table.loc[[i for i in table.index if i.startswith("table1/")], "verdict"]) == {"cannot be judged"}


@pytest.mark.parametrize(
    ("difference", "margin", "expected"),
    [(1.0, 0.1, True), (-1.9, 1.9, True), (2.5, 0.1, False), (9.0, 5.0, False), (4.0, 3.0, None), (0.1, np.nan, None)],
)
def test_within(difference, margin, expected):
    assert Mean(difference, margin).is_within(2.0) is expected


@pytest.mark.parametrize(
    ("difference", "margin", "expected"),
    [(6.0, 1.0, True), (3.0, 1.0, False), (-9.0, 2.0, False), (6.0, 7.0, None), (4.0, 2.0, None)],
)
def test_exceeds(difference, margin, expected):
    assert Mean(difference, margin).exceeds(5.0) is expected


def test_the_page_counts_the_verdicts():
    table = build_ledger().reset_index()
    page = format_ledger(table)
    for verdict in VERDICTS:
        assert f"- {(table['verdict'] == verdict).sum()} × {verdict}" in page
    assert page.count("\n| ") == len(table) + 1
    assert "Condition: one pass" in page
