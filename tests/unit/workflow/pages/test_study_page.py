"""What the notebooks of all studies share."""

import re

import pandas as pd
import pytest
from matplotlib.figure import Figure

from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.pages.report import render_faults, render_sources
from ankleloop_workflow.pages.study_page import StudyPage


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
            "point.reflex_gain": gain,
            "point.closed_loop": False,
            "point.snr_db": None,
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
        varied=["reflex_gain", "closed_loop", "snr_db"],
        figures=["curves"],
        figure={"methods": None, "trial": 0, "start": 0.0, "length": 5.0},
        published="data/published",
        table_stem=str(tmp_path / "s"),
        figure_stem=str(tmp_path / "s"),
        table_file=str(tmp_path / "s-trials.parquet"),
    )


def test_trials_and_settings_stand_once_at_the_end_with_what_is_not_by_default(page):
    for values in page.points.values():
        values["amplitude"] = 0.05
    part = render_sources(page)
    assert page.typical == "g=13"
    assert "Trials and settings: 2 trials at each point; inertia of the load" in part
    assert "amplitude 0.05 rad" in part
    assert "reflex gain" not in part
    for path in ("notebooks/s.ipynb", "tables/s.csv", "tables/s-trials.parquet"):
        assert f'href="../{path}"' in part
    assert "snakemake results/reports/s.html" in part


def test_failures_and_warnings_are_counted_at_the_top_and_listed_with_reasons_at_the_end(page):
    sentence, part = render_faults(page)
    assert sentence == (
        "Of 8 identifications 1 failed and 1 came with a warning: see the end of this page. A ring in a figure marks a "
        "mean of which at least 5 % did, on a curve as many more than at its median point."
    )
    assert "<h2>Failures and warnings</h2>" in part
    cells = [re.findall("<td.*?>(.*?)</td>", row) for row in part.split("<tr>")[2:]]
    setting = "reflex gain 5 N·m·s/rad, open loop"
    assert cells == [
        ["RIV", "failure", "no pole", "1", setting],
        ["PR &lt;&amp;&gt;", "warning", "unstable", "1", setting],
    ]
    page.details[["failure", "warnings"]] = None
    assert render_faults(page) == ("", "")


def test_a_figure_of_a_trial_that_failed_by_every_method_is_refused(page):
    assert list(page.select_estimates({"riv": {}, "pr": {0: "estimate"}}, ["riv", "pr"])) == [
        "PR <&>"
    ]
    with pytest.raises(ValueError, match="set another number as figure: trial"):
        page.select_estimates({"riv": {}, "pr": {1: "estimate"}}, ["riv", "pr"])


def test_a_page_that_reads_no_points_says_what_to_add(page):
    page.points = {}
    with pytest.raises(
        ValueError, match=r"add points to reads of the notebook in notebooks/notebooks\.yaml"
    ):
        page.show_table(pd.DataFrame(), "A table.", table=pd.DataFrame())


def test_a_figure_without_numbers_says_how_to_give_them(page):
    with pytest.raises(ValueError, match=r"'curves' has no table .*: set figure\.data = table"):
        page.show_figure(Figure(), "curves", "Curves.")


def test_what_a_notebook_has_not_written_is_named(page, tmp_path):
    page.figures = ["curves"]
    page.figure_stem = page.table_stem = str(tmp_path / "s")
    with pytest.raises(ValueError, match=r"gain\.ipynb has not drawn the figure 'curves', which"):
        page.check_written("gain.ipynb")
    (tmp_path / "s-curves.png").touch()
    with pytest.raises(ValueError, match=r"gain\.ipynb has written no table of the study: call"):
        page.check_written("gain.ipynb")
    (tmp_path / "s.csv").touch()
    page.check_written("gain.ipynb")
