"""The list of notebooks: it has every notebook of studies, and each is refused what it cannot show."""

from pathlib import Path

import pytest

from ankleloop_lab.checking import ConfigError
from ankleloop_workflow.config.notebooks import list_figures, read_notebooks
from ankleloop_workflow.config.run import read_run
from ankleloop_workflow.config.study import read_studies
from ankleloop_workflow.pages.study_page import StudyPage

NOTEBOOKS = read_notebooks()


def read(**settings):
    study = {"kind": "simulation", "seed": 1, "trials": 2, "notebook": "sweep"}
    study |= {"points": {"voluntary": [0.1, 0.5]}, "methods": {"riv": {"method": "riv"}}}
    return read_run({"studies": {"s": study | settings}}, [])[1]["s"]


def test_unknown_notebooks_and_those_of_other_studies_are_refused():
    with pytest.raises(
        ConfigError, match=r"no notebook 'sweeps' for simulation \(did you mean 'sweep'"
    ):
        read(notebook="sweeps")
    with pytest.raises(ConfigError, match="no notebook 'recordings' for simulation"):
        read(notebook="recordings")
    read(notebook=None)


STILL = (
    "a Cramér-Rao bound at every point: reflex_threshold, variation, movement, locked_torque must"
)
MOVING = (
    "a bound of the trajectories at every point: set reflex_threshold: 0, and snr_db or voluntary"
)
TIME_VARYING = {
    "notebook": "time-varying",
    "keep": "estimates",
    "methods": {"riv-tv": {"method": "riv-tv"}},
}


@pytest.mark.parametrize(
    ("settings", "simulation", "message"),
    [
        ({"notebook": "design"}, {"reflex_threshold": 0.1}, f"design needs {STILL}"),
        ({"notebook": "design"}, {"movement": 0.1}, f"design needs {STILL}"),
        ({"notebook": "design"}, {"switching_interval": 0.2}, "needs one point with the usual"),
        (TIME_VARYING, {"reflex_threshold": 0.1}, f"time-varying needs {MOVING}"),
        (TIME_VARYING, {"snr_db": None}, f"time-varying needs {MOVING}"),
    ],
)
def test_a_point_that_has_no_bound_is_refused(settings, simulation, message):
    points = {"voluntary": [0.0, 0.5]}
    varying = {"variation": "cycle"} if settings is TIME_VARYING else {}
    read(**settings, points=points, simulation=varying)
    with pytest.raises(ConfigError, match=message):
        read(**settings, points=points, simulation=varying | simulation)


def test_steps_are_compared_with_all_of_them():
    """Else every job would run before the notebook has nothing to compare."""
    methods = {"pr": {"method": "pr-moesp"}}
    read(notebook="obstacles", methods=methods, points={"omitted_step": [None, "scaling"]})
    with pytest.raises(ConfigError, match="obstacles needs a point with all steps"):
        read(notebook="obstacles", methods=methods, points={"omitted_step": ["scaling"]})


def test_steps_have_no_bound_and_need_none():
    simulation = {"variation": "cycle", "variation_shape": "square", "snr_db": None}
    read(**TIME_VARYING, points={"voluntary": [0.0, 0.5]}, simulation=simulation)


def test_a_figure_is_listed_where_a_study_has_what_it_shows():
    moesp = {"methods": {"pr": {"method": "pr-moesp"}}}
    assert list(list_figures(read(), NOTEBOOKS["table1"])) == ["figure3"]
    assert list(list_figures(read(**moesp), NOTEBOOKS["table1"])) == ["figure3", "order"]
    labels = [("A", "rest"), ("A", "MVC"), ("B", "rest"), ("B", "MVC")]
    for chosen, figures in ((labels, ["group", "comparison"]), (labels[:2], ["group"])):
        files = {
            f"r{number}": {"file": "a.mat", "subject": subject, "condition": condition}
            for number, (subject, condition) in enumerate(chosen)
        }
        study = {"kind": "recordings", "folder": str(Path()), "files": files}
        study["methods"] = {"riv": {"method": "riv"}}
        recorded = read_studies({"studies": {"s": study}, "run": ["s"]})[1]["s"]
        assert list(list_figures(recorded, NOTEBOOKS["recordings"])) == figures


def test_a_figure_that_is_not_listed_is_an_error():
    with pytest.raises(ValueError, match=r"the figure 'other' is not in notebooks/notebooks\.yaml"):
        StudyPage(figures=["sweep"]).check_figure("other")


def test_another_list_of_notebooks_is_read(tmp_path: Path):
    path = tmp_path / "notebooks.yaml"
    path.write_text("mine: {shows: What I look at., figures: {first: A figure.}}\n")
    mine = read_notebooks(path)
    assert mine["mine"].reads == ["points"]
    config = {"kind": "simulation", "seed": 1, "notebook": "mine"}
    config |= {"methods": {"riv": {"method": "riv"}}}
    read_run({"studies": {"s": config}}, [], notebooks=mine)
    path.write_text("mine: {shows: What I look at., figures: {}, needs: [luck]}\n")
    with pytest.raises(ConfigError, match="mine → needs"):
        read_notebooks(path)
