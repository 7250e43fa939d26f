"""The ledger: every check on both sides of its limit, with one trial, without results, with points in any order."""

import numpy as np
import pandas as pd
import pytest
from synthetic_results import (
    CASCADES,
    CLAIMS,
    FINDINGS,
    MEASUREMENTS,
    PAPER,
    POINTS,
    TABLES,
    build_ledger,
)

from ankleloop_workflow.paper import checks
from ankleloop_workflow.paper.judgement import (
    BY_CONSTRUCTION,
    CONDITIONAL,
    CONTRADICTION,
    NOT_REPRODUCED,
    OPEN,
)
from ankleloop_workflow.paper.ledger import VERDICTS

ROWS = {
    name: [f"{name}/{n.method}/{n.torque}" for n in TABLES[name].itertuples()] for name in TABLES
}
IDS = [*CLAIMS["id"], *FINDINGS["id"]]
HOLDS = "holds"  # reproduced, or reproduced under the stated conditions of the claim


def verdict_of(claim, **results):
    """Verdict on a claim; a stated condition counts as reproduced."""
    claims = results.pop("claims", CLAIMS)
    ledger = build_ledger(
        claims=claims[claims["id"] == claim],
        findings=FINDINGS[FINDINGS["id"] == claim],
        tables={name: table[:0] for name, table in TABLES.items()},
        **results,
    )
    verdict = ledger.loc[claim, "verdict"]
    return HOLDS if verdict.startswith("reproduced") else verdict


def vaf_at(study, value, methods=None, torques=None, **settings):
    """VAFs that differ from the default at some points, methods and torques."""

    def vaf(name, values, method, torque):
        chosen = (
            name == study
            and (not methods or method in methods)
            and (not torques or torque in torques)
        )
        return value if chosen and settings.items() <= values.items() else None

    return {"vaf": vaf}


def error_at(study, value, *methods, **settings):
    """Errors of K that differ from the default at some points and methods."""

    def error(name, values, method):
        chosen = (
            name == study
            and (not methods or method in methods)
            and settings.items() <= values.items()
        )
        return value if chosen else None

    return {"error": error}


def limits(inside, outside):
    return [(HOLDS, inside), (NOT_REPRODUCED, outside)]


def edit_claims(claim, **values):
    claims = CLAIMS.astype(object)
    claims.loc[claims["id"] == claim, list(values)] = list(values.values())
    return {"claims": claims}


TORQUES = ("net", "intrinsic", "reflex")
ONE_PASS = CASCADES[:1]
CASES = {
    "openloop-biased": [
        (HOLDS, {}),
        *(
            (NOT_REPRODUCED, error_at("voluntary", error, method, voluntary=0.5, closed_loop=loop))
            for method in ("pi-moesp", "po-moesp", "parallel-cascade")
            # Not off in closed loop, or off in open loop, too: the control counts.
            for error, loop in ((4.99, True), (5.01, False))
        ),
        (NOT_REPRODUCED, error_at("real-time", 4.99, perturbation="pulses")),
        (NOT_REPRODUCED, error_at("real-time", 34.0, perturbation="pulses")),
    ],
    "eiv-unbiased": [
        *limits({}, error_at("voluntary", 5.01, "eiv-moesp", voluntary=1.0, closed_loop=True)),
        (HOLDS, error_at("voluntary", 9.0, "eiv-moesp", closed_loop=False)),
    ],
    "riv-unbiased": limits({}, error_at("voluntary", 5.01, "riv", voluntary=0.5, closed_loop=True)),
    "net-vaf-hides-bias": [
        (NOT_REPRODUCED, {}),
        (HOLDS, error_at("voluntary", -5.01, "pr-moesp", voluntary=1.0, closed_loop=True)),
        (
            NOT_REPRODUCED,
            error_at("voluntary", -5.01, "pr-moesp", voluntary=1.0)
            | vaf_at("voluntary", 50.01, ["riv"], ["net"]),
        ),
    ],
    "criteria": [
        (HOLDS, {}),
        (NOT_REPRODUCED, vaf_at("choosing", 55.9, ["pr-moesp"], ["net"])),
        (NOT_REPRODUCED, vaf_at("choosing", 55.9, ["pr-moesp"], ["unseen_cross_validation"])),
        (NOT_REPRODUCED, vaf_at("choosing", 56.1, ["pr-moesp"], ["unseen_instrumental"])),
    ],
    "pr-above-cascade": limits({}, vaf_at("table1", 55.9, ["pr-moesp"], ["intrinsic"])),
    "pr-unbiased": limits(
        {}, error_at("voluntary", -5.01, "pr-moesp", voluntary=0.25, closed_loop=True)
    ),
    "pr-accurate": limits(
        {},
        {
            "error": lambda _, __, method: (
                2.01 if method in ("pr-moesp", "ordinary", "pr-chebyshev") else None
            )
        },
    ),
    "pr-accurate-rectifier": limits(
        {}, {"error": lambda _, __, method: -2.01 if "rectifier" in method else None}
    ),
    "similar": [
        (HOLDS, {}),
        *(
            (
                NOT_REPRODUCED,
                vaf_at("table1", PAPER["pr-moesp", torque] - 2.01, ["eiv-moesp"], [torque]),
            )
            for torque in TORQUES
        ),
    ],
    "cascade-net-good": [
        *limits(
            vaf_at("table1", 80.0, ONE_PASS, ["net"]), vaf_at("table1", 79.99, ONE_PASS, ["net"])
        ),
        *limits(
            vaf_at("table1", 80.0, ONE_PASS, ["reflex"]),
            vaf_at("table1", 80.01, ONE_PASS, ["reflex"]),
        ),
    ],
    "cascade-openloop": [
        *limits({}, vaf_at("voluntary", 54.99, ONE_PASS, ["intrinsic"], closed_loop=False)),
        (NOT_REPRODUCED, vaf_at("voluntary", 54.99, ONE_PASS, ["reflex"], closed_loop=False)),
    ],
    "figure4-pr": [
        (HOLDS, {}),
        *(
            (NOT_REPRODUCED, vaf_at("figure4", 96.99, ["pr-moesp"], [torque], reflex_gain=gain))
            for torque, gain in zip(TORQUES, (10.0, 17.0, 30.0), strict=True)
        ),
    ],
    "figure4-cascade-biased": [
        *limits({}, vaf_at("figure4", 90.01, ONE_PASS, ["intrinsic"], reflex_gain=10.0)),
        *limits(
            vaf_at("figure4", 80.0, ONE_PASS, reflex_gain=30.0),
            vaf_at("figure4", 80.01, ONE_PASS, reflex_gain=30.0),
        ),
    ],
    "figure4-cascade-falls": [
        (HOLDS, {}),
        (NOT_REPRODUCED, vaf_at("figure4", 60.0, ONE_PASS, reflex_gain=10.0)),
        (NOT_REPRODUCED, vaf_at("figure4", 90.0, ONE_PASS, reflex_gain=30.0)),
    ],
    "figure4-cause": limits({}, vaf_at("figure4", 99.01, ["parallel-cascade"], ["intrinsic"])),
    "figure4-count": [
        (CONTRADICTION, {}),
        (BY_CONSTRUCTION, edit_claims("figure4-count", paper=21)),
    ],
    "cascade-stop": [
        (NOT_REPRODUCED, {}),
        (HOLDS, vaf_at("table1", 56.0, ["parallel-cascade"], ["intrinsic"], reflex_gain=13.0)),
    ],
    "eq17-gain": limits({}, vaf_at("table1", 58.01, ONE_PASS, ["intrinsic"], reflex_gain=2.0)),
    "eq10-constant": [(BY_CONSTRUCTION, {})],
    "eq11-zero": limits(
        vaf_at("table1", 92.5, ["pr-moesp-free-b"], ["net"]),
        vaf_at("table1", 92.51, ["pr-moesp-free-b"], ["net"]),
    ),
    "columns-eiv": [
        (BY_CONSTRUCTION, {}),
        (NOT_REPRODUCED, {"measurements": {"eiv-moesp_instrument_rows": (120, np.nan, np.nan)}}),
    ],
    "columns-pr": [
        (BY_CONSTRUCTION, {}),
        (NOT_REPRODUCED, {"measurements": {"pr-moesp_instrument_rows": (30, np.nan, np.nan)}}),
    ],
    "economy-time": [
        *limits({}, {"measurements": {"milliseconds_ratio": (0.9, 0.8, 0.99)}}),
        (OPEN, {"measurements": {"milliseconds_ratio": (1.2, 0.99, 1.4)}}),
    ],
    "economy-memory": limits({}, {"measurements": {"megabytes_ratio": (0.9, 0.9, 0.9)}}),
    "table2-text": [(CONTRADICTION, {}), (BY_CONSTRUCTION, edit_claims("table2-text", paper=32))],
    "real-time-input": [
        *limits({}, error_at("real-time", 4.99, perturbation="prbs")),
        (HOLDS, error_at("real-time", -4.99, perturbation="pulses")),
        (NOT_REPRODUCED, error_at("real-time", -5.01, perturbation="pulses")),
    ],
}
FACTS = ("figure4-count", "eq10-constant", "columns-eiv", "columns-pr", "table2-text")
MEASURED = {
    "columns-eiv": "eiv-moesp_instrument_rows",
    "columns-pr": "block_rows",
    "economy-time": "milliseconds_ratio",
    "economy-memory": "megabytes_ratio",
}
STATED = {
    "figure4-count": CONTRADICTION,
    "table2-text": CONTRADICTION,
    "eq10-constant": BY_CONSTRUCTION,
}
STATISTICAL = [claim for claim in IDS if claim not in FACTS]
OVER_TRIALS = [
    claim for claim in STATISTICAL if claim not in MEASURED and not claim.startswith("drawn-")
]


@pytest.mark.parametrize(
    ("claim", "verdict", "results"),
    [(claim, *case) for claim, cases in CASES.items() for case in cases],
)
def test_both_sides_of_a_limit(claim, verdict, results):
    assert verdict_of(claim, **results) == verdict


@pytest.mark.parametrize("case", range(2))
def test_one_trial_is_never_judged(case):
    """Neither a result within what is accepted nor one far outside."""
    far = (
        {"vaf": lambda _, settings, *__: settings["reflex_gain"], "error": lambda *_: 40.0}
        if case
        else {}
    )
    pooled = ("pr-accurate", "pr-accurate-rectifier")  # over the trials of several studies
    ledger = build_ledger(**far, trials=1)
    rows = ledger.loc[[*ROWS["table1"], *(claim for claim in OVER_TRIALS if claim not in pooled)]]
    assert set(rows["verdict"]) == {OPEN}
    assert rows["reason"].str.contains("no interval").all()
    assert rows["difference_low"].isna().all()


@pytest.fixture(scope="module")
def empty_ledger():
    return build_ledger(studies={}, measurements=dict.fromkeys(MEASUREMENTS))


@pytest.mark.parametrize("claim", IDS)
def test_a_missing_study_or_measurement_leaves_the_claim_open(claim, empty_ledger):
    row = empty_ledger.loc[claim]
    assert row["verdict"] == STATED.get(claim, OPEN)
    if claim not in STATED:
        assert any(words in row["reason"] for words in ("was not run", "was not measured"))
        assert np.isnan(row["ours"])


def test_a_missing_point_leaves_the_claim_open():
    """Without half of the points of each study a claim keeps its verdict or is open; each claim on trials needs one."""
    complete, needed = build_ledger()["verdict"], set()
    for half in range(2):
        fewer = {study: points[half::2] for study, points in POINTS.items()}
        ledger = build_ledger(points={study: points for study, points in fewer.items() if points})
        changed = ledger[ledger["verdict"] != complete]
        assert set(changed["verdict"]) <= {OPEN}
        assert changed["reason"].str.contains("has no point with|was not run").all()
        needed |= set(changed.index)
    assert needed >= {*OVER_TRIALS, *ROWS["table1"]}


def test_order_and_further_points_change_nothing():
    """Points are found by their values: those in another order, and one that differs in a setting no claim names."""
    order = {study: points[::-1] for study, points in POINTS.items()}
    further = {
        study: [{**points[0], "load_inertia": 3.0}, {"reflex_gain": 35.0, "inertia": 0.02}, *points]
        for study, points in POINTS.items()
        if study != "table2"
    }
    vaf = {"vaf": lambda _, settings, *__: -50.0 if settings["load_inertia"] == 3.0 else None}
    columns = ["verdict", "ours", "difference", "reason"]
    for results in ({"points": order}, {"points": POINTS | further, **vaf}):
        pd.testing.assert_frame_equal(build_ledger(**results)[columns], build_ledger()[columns])


def test_every_number_and_claim_has_a_row_and_a_verdict_with_a_reason():
    table = build_ledger()
    named = {f"check_{check.split()[0]}" for check in [*CLAIMS["check"], *FINDINGS["check"]]}
    assert named == {name for name in vars(checks) if name.startswith("check_")}
    assert set(CLAIMS["id"]) <= set(table.index)
    assert len(table) == len(CLAIMS) + 18 + len(FINDINGS)
    assert table.index.is_unique
    assert set(table["verdict"]) <= set(VERDICTS)
    assert table["reason"].str.match(r".*[^.]\.$").all()
    assert table["how"].notna().all()
    assert not table["reason"].str.contains("nan").any()


def test_numbers_of_a_table_follow_the_results():
    def shift(points):
        def vaf(study, _, method, torque):
            return (
                PAPER[method, torque] + points
                if study == "table1" and (method, torque) in PAPER
                else None
            )

        return {"vaf": vaf}

    rows = build_ledger(**shift(2.0)).loc[ROWS["table1"]]
    assert set(rows["verdict"]) == {CONDITIONAL}
    for points in (2.5, -2.5):
        rows = build_ledger(**shift(points)).loc[ROWS["table1"]]
        assert set(rows["verdict"]) == {NOT_REPRODUCED}
        np.testing.assert_allclose(rows["difference"].astype(float), points)


def test_a_simulated_stand_in_has_no_verdict():
    stand_in = build_ledger().loc[ROWS["table2"]]
    assert set(stand_in["verdict"]) == {OPEN}
    assert stand_in["reason"].str.contains("stand-in").all()
