"""What the notebooks of all studies share."""

import pandas as pd
import pytest

from ankleloop.pages.study_page import StudyPage, fold
from ankleloop.simulation.settings import SimulationSettings


@pytest.fixture
def page(tmp_path):
    """Two gains, two methods, two trials; one identification failed and one came with a warning."""
    keys = [
        (gain, method, trial)
        for gain in (5.0, 13.0)
        for method in ("riv", "pr")
        for trial in range(2)
    ]
    rows = [
        {
            "study": "s",
            "point": f"g={gain:g}",
            "reflex_gain": gain,
            "method": method,
            "trial": trial,
        }
        for gain, method, trial in keys
    ]
    table = pd.DataFrame(rows).assign(
        vaf_net_measured=90.0, vaf_net_measured_low=89.0, vaf_net_measured_high=91.0
    )
    table = table.assign(K=150.0, failure=None, warnings=None)
    table.loc[0, ["K", "vaf_net_measured", "failure"]] = [None, None, "no pole"]
    table.loc[3, "warnings"] = "unstable"
    table.to_parquet(tmp_path / "s-trials.parquet")
    return StudyPage(
        study="s",
        title="A study",
        labels={"riv": "RIV", "pr": "PR <&>"},
        algorithms={"riv": "riv", "pr": "pr-moesp"},
        points={
            f"g={gain:g}": SimulationSettings(reflex_gain=gain).model_dump() for gain in (5.0, 13.0)
        },
        varied=["reflex_gain"],
        figures=["curves"],
        figure={"methods": None, "trial": 0, "start": 0.0, "length": 5.0},
        published="data/published",
        table_stem=str(tmp_path / "s"),
        figure_stem=str(tmp_path / "s"),
        table_file=str(tmp_path / "s-trials.parquet"),
    )


def test_the_note_of_a_figure_counts_trials_and_says_what_rings_are(page):
    note = page.fold("A note.").data
    assert page.typical == "g=13"
    for words in (
        "A note.",
        "2 trials at each point",
        "1 of 8 (RIV 1)",
        "1 of 8 (PR &lt;&amp;&gt; 1)",
        "In figures they have rings",
    ):
        assert words in note
    assert (
        fold("<b>", ["a", "", "b"]).data
        == "<details><summary>&lt;b&gt;</summary><p>a b</p></details>"
    )


def test_a_figure_of_a_trial_that_failed_by_every_method_is_refused(page):
    assert list(page.select_estimates({"riv": {}, "pr": {0: "estimate"}}, ["riv", "pr"])) == [
        "PR <&>"
    ]
    with pytest.raises(ValueError, match="set another number as figure: trial"):
        page.select_estimates({"riv": {}, "pr": {1: "estimate"}}, ["riv", "pr"])
