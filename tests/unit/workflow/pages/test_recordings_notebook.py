"""The notebook of recordings: it opens with the recommended methods, and shows recordings that were all refused."""

import pandas as pd
import pytest
from study_jobs import run_cells

REFUSED = {
    "recording": "A2",
    "subject": "Ann",
    "condition": "rest",
    "trial": None,
    "session": None,
    "verdict": "refused",
    "reasons": "torque: there is a gap",
    "valid": False,
    "trusted": False,
    "key": None,
    "recommended": False,
    "recommendation": "Nothing can be concluded.",
}
FITTED = {**REFUSED, "recording": "A1", "verdict": "ok", "loop": "closed", "reasons": None}
FITTED |= {"valid": True, "trusted": True, "vaf_unseen": 90.0, "K": 150.0, "warnings": None}
RIV = {**FITTED, "key": "riv", "method": "riv", "label": "RIV", "K_low": 148.0, "K_high": 152.0}
PR = {**FITTED, "key": "pr", "method": "pr-moesp", "label": "PR", "K": 90.0, "trusted": False}


@pytest.fixture
def run_notebook(tmp_path):
    """Run the cells of the notebook on a table; what they show, and where the results are."""

    def run(*rows):
        pd.DataFrame(rows).to_parquet(tmp_path / "0.parquet")
        study = {"study": "s", "title": "S", "figures": ["group", "comparison"]}
        study["tables"] = [str(tmp_path / "0.parquet")]
        study["table_stem"] = study["figure_stem"] = str(tmp_path / "s")
        return run_cells("recordings", {"study": study}), tmp_path

    return run


@pytest.mark.usefixtures("coarse_pictures")
def test_the_first_table_and_the_figure_have_the_recommended_methods(run_notebook):
    rows = [{**RIV, "recommended": True}, {**PR, "warnings": "no pole"}, REFUSED]
    shown, folder = run_notebook(*rows)
    assert "2 recordings: 1 ok, 0 warning, 1 refused." in shown
    first = shown.partition("</table>")[0]
    assert "150 (148 … 152)" in first
    assert "<td>PR" not in first
    assert 'href="s/A2.html"' in first
    drawn = pd.read_csv(folder / "s-group.csv")
    assert drawn["series"].dropna().unique().tolist() == ["RIV"]
    assert drawn["row"].unique().tolist() == ["A1 (Ann, rest)", "A2 (Ann, rest)"]
    numbers = (folder / "s.md").read_text(encoding="utf-8")
    assert "RIV" in numbers
    assert "PR (warning)" in numbers
    assert pd.read_csv(folder / "s.csv")["method"].dropna().tolist() == ["riv", "pr"]


@pytest.mark.usefixtures("coarse_pictures")
def test_recordings_that_were_all_refused_have_a_page_and_a_figure(run_notebook):
    shown, folder = run_notebook(REFUSED, {**REFUSED, "recording": "A3"})
    assert "2 recordings: 0 ok, 0 warning, 2 refused." in shown
    assert "A3 was refused:</b> torque: there is a gap" in shown
    assert (folder / "s-group.png").stat().st_size > 0
    assert pd.read_csv(folder / "s-comparison.csv").empty
    assert pd.read_csv(folder / "s.csv")["recording"].tolist() == ["A2", "A3"]


@pytest.mark.usefixtures("coarse_pictures")
def test_the_page_answers_in_its_first_sentence(run_notebook):
    """Of several subjects and conditions, by the method that is recommended most often."""
    stiffness = {"Ann": (100.0, 141.0), "Bea": (120.0, 160.0), "Cat": (80.0, 122.0)}
    rows = []
    for subject, values in stiffness.items():
        for condition, value in zip(("rest", "10MVC"), values, strict=True):
            row = {**RIV, "subject": subject, "condition": condition, "K": value}
            rows.append({**row, "recording": f"{subject}-{condition}", "recommended": True})
            rows.append({**rows[-1], "label": "PR", "K": 10.0 * value, "recommended": False})
    shown, folder = run_notebook(*rows)
    answer = "K rises by 41 (38.52 … 43.48) N·m/rad from rest to 10MVC (3 subjects, paired 95 % intervals)."
    assert shown.startswith(f"# S\n{answer}")  # below the title of the study
    drawn = pd.read_csv(folder / "s-comparison.csv").set_index(["series", "x"])["value"]
    assert drawn["subject Bea", 1.0] == 160.0
    assert drawn["mean over subjects", 0.0] == pytest.approx(100.0)
