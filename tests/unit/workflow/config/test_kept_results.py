"""What a study keeps, what its notebook needs of it, and what the notebook is given."""

import pytest

from ankleloop_lab.checking import ConfigError
from ankleloop_workflow.config.run import read_run

METHODS = {
    "pr-moesp": {"method": "pr-moesp"},
    "parallel-cascade": {"method": "parallel-cascade"},
    "real-time": {"method": "real-time"},
}


def read(methods=("pr-moesp", "parallel-cascade"), **changes):
    study = {"kind": "simulation", "seed": 1, "trials": 2, "simulation": {"duration": 40.0}}
    study |= {
        "points": {"reflex_gain": [8.0, 12.0]},
        "methods": {name: METHODS[name] for name in methods},
    }
    return read_run({"studies": {"s": study | changes}}, [])[1]["s"]


LOOPS = {"methods": ["real-time"], "points": {"closed_loop": [True, False]}}
REFUSED = [
    ("table1", {}, "trials on disk, which keep: scores leaves out: set keep: everything"),
    ("traces", LOOPS, "estimates on disk, which keep: scores leaves out: keep estimates"),
]


@pytest.mark.parametrize(("notebook", "settings", "need"), REFUSED)
def test_a_notebook_that_needs_what_is_not_kept_is_refused_before_the_first_job(
    notebook, settings, need
):
    with pytest.raises(ConfigError, match=f"studies → s → notebook: {notebook} needs {need}"):
        read(notebook=notebook, keep="scores", **settings)
    read(notebook=notebook, keep="everything", **settings)


def test_notebooks_that_know_settings_alone_refuse_options_before_the_first_job():
    points = {"reflex_gain": [8.0, 12.0], "block_rows": [12, 15]}
    match = "studies → s → notebook: table1 needs points that differ in settings of the simulation alone, "
    match += "got block_rows"
    with pytest.raises(ConfigError, match=match):
        read(notebook="table1", points=points)
    read(notebook="sweep", points=points)


def test_traces_have_one_true_value_of_each_parameter():
    settings = {"methods": ["real-time"], "notebook": "traces"}
    with pytest.raises(
        ConfigError, match="same stiffness, viscosity, inertia and reflex gain, got"
    ):
        read(points={"reflex_gain": [8.0, 12.0]}, **settings)
    read(points={"closed_loop": [True, False]}, **settings)


def test_two_studies_do_not_write_one_table():
    study = {"kind": "simulation", "seed": 1, "methods": {"riv": {"method": "riv"}}}
    with pytest.raises(ConfigError, match="'a-trials' has the table of all trials of 'a'"):
        read_run({"studies": {"a": study, "a-trials": study}}, [])
    read_run({"studies": {"a": study, "b-trials": study}}, [])
