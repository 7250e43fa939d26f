"""Results of the reduced configuration against those that are expected."""

from pathlib import Path

import pandas as pd
import pytest
import yaml
from expectations import LEAST, SHARE, list_differences, summarise_results

EXPECTED = Path(__file__).parent / "expected"
CI = Path(__file__).parents[2] / "config" / "ci.yaml"
STUDIES = list(yaml.safe_load(CI.read_text(encoding="utf-8"))["studies"])


@pytest.mark.workflow
@pytest.mark.parametrize("study", STUDIES)
def test_results_are_those_expected(reproduction, study, request):
    results = summarise_results(reproduction / "results", study)
    path = EXPECTED / f"{study}.csv"
    if request.config.getoption("--update-expected"):
        results.to_csv(path, index=False, float_format="%.7g", lineterminator="\n")
        return
    changed = list_differences(pd.read_csv(path), results)
    assert changed.empty, (
        f"{len(changed)} results of the study {study} have changed by more than {SHARE:g} of their standard error "
        f"(or {LEAST:g} of themselves):\n\n{changed.to_string(index=False, float_format='%.5g')}\n\n"
        "If that is on purpose, run: make expected, and say in the commit why."
    )


def test_every_study_has_expected_results_and_every_tolerance_comes_from_a_spread():
    assert {path.stem for path in EXPECTED.glob("*.csv")} == set(STUDIES)
    for path in EXPECTED.glob("*.csv"):
        rows = pd.read_csv(path)
        assert (rows["n"] > 1).all()
        share = rows["tolerance"] / (rows["sd"] / rows["n"] ** 0.5)
        least = rows["tolerance"] / rows["mean"].abs()
        assert ((share - SHARE).abs().lt(1e-4) | (least - LEAST).abs().lt(1e-7)).all()
