"""Studies of recordings of the configuration, and notebooks of studies."""

from typing import Any

from bad_inputs.bad_input import BadInput
from bad_inputs.config_inputs import read_config_with_an_empty_variable, recordings, row, study

TITLE = "Configuration: notebooks and recordings"


def _rows_of_notebooks() -> list[BadInput]:
    """What a notebook needs of its study, which would otherwise be found after all trials."""
    place = "config → studies → s → notebook"
    two = {"reflex_gain": [5.0, 13.0], "voluntary": [0.0, 0.1]}
    cascade = {"a": {"method": "parallel-cascade"}}

    def notebook(name: str, **keys: Any):
        return study(notebook=name, **keys)

    return [
        row("Figure 4 of one point", notebook("figure4"), f"{place}: figure4 needs one setting", "got none"),
        row(
            "Figure 4 of two settings",
            notebook("figure4", points=two),
            "needs one setting",
            "got reflex_gain, voluntary",
        ),
        row(
            "Figure 4 without the parallel cascade",
            notebook("figure4", points={"reflex_gain": [5.0, 13.0]}),
            f"{place}: figure4 needs a method parallel-cascade",
        ),
        row(
            "Figure 4 against the measured torque",
            notebook("figure4", points={"reflex_gain": [5.0, 13.0]}, methods=cascade, against="measured"),
            "needs scores against the true torques: leave out against: measured",
        ),
        row(
            "Figure 4 against a setting that is null",
            notebook("figure4", points={"snr_db": [None, 10.0]}, methods=cascade),
            "needs numbers as values of snr_db, got None",
        ),
        row("a comparison of one point", notebook("comparison"), "comparison needs a setting beside closed_loop"),
        row(
            "a comparison of a grid",
            notebook("comparison", points=two),
            "needs one value of voluntary for each value of",
        ),
        row("traces of another method", notebook("traces"), "traces needs one method, real-time, got pr-moesp"),
        row(
            "traces of several truths",
            notebook("traces", methods={"a": {"method": "real-time"}}, points={"reflex_gain": [5.0, 13.0]}),
            "needs points with the same K, B, I and G",
        ),
        row(
            "a map of one setting",
            notebook("sensitivity"),
            "sensitivity needs two settings or more that differ, got none",
        ),
        row(
            "a map without a stop rule", notebook("sensitivity", points=two), "whose name begins with parallel-cascade"
        ),
        row(
            "efficiency without intervals of the delay",
            notebook("efficiency"),
            "needs a method riv with the option delay: n",
        ),
        row(
            "a choice without selections",
            notebook("choosing", points={"voluntary": [0.0, 0.1]}),
            "choosing needs select for every method, got none for a",
        ),
        row(
            "time-varying joints that are constant",
            notebook("time-varying"),
            "time-varying needs variation (of K, B and G) at every point, got none at only",
        ),
        row(
            "time-varying joints without trajectories",
            notebook("time-varying", simulation={"variation": "cycle"}),
            "time-varying needs a method riv-tv, for its trajectories",
        ),
        row(
            "obstacles without a filter",
            notebook("obstacles", simulation={"antialias_cutoff": None}),
            "obstacles needs a point with the anti-aliasing filter",
        ),
    ]


def _rows_of_recordings() -> list[BadInput]:
    place = "config → studies → r"
    return [
        row(
            "a recording without a file",
            recordings(files={"S1": {"torque": "t"}}),
            f"{place} → files → S1: the key 'file' is missing",
        ),
        row(
            "no recordings",
            recordings(files={}),
            "study r: name its recordings under files, or a table that lists them",
        ),
        row(
            "a name of a recording that is a path",
            recordings(files={"a/b": {"file": "a.mat"}}),
            f"{place} → files → a/b",
        ),
        row(
            "a subject that YAML reads as a number",
            recordings(files={"S1": {"file": "a.mat", "subject": 7}}),
            f"{place} → files → S1 → subject: must be text, got 7",
            "quotes",
        ),
        row(
            "cycles and a schedule",
            recordings(files={"S1": {"file": "a.mat", "cycle_onsets": "phase", "schedule": "angle"}}),
            f"{place} → files → S1",
            "cycle_onsets and schedule exclude each other",
        ),
        row(
            "a sign of 0",
            recordings(files={"S1": {"file": "a.mat", "torque_sign": 0}}),
            f"{place} → files → S1 → torque_sign",
            "got 0",
        ),
        row(
            "a part that ends before it starts",
            recordings(files={"S1": {"file": "a.mat", "start": 9.0, "stop": 3.0}}),
            f"{place} → files → S1",
            "stop",
            "start",
        ),
        row(
            "a default for the file",
            recordings(defaults={"file": "a.mat"}),
            f"{place}: defaults: the key 'file' has no default",
        ),
        row("an unknown default", recordings(defaults={"torqe_sign": -1}), place, "unknown key 'torqe_sign'"),
        row(
            "a folder in a variable that is not set",
            recordings(folder="${NO_SUCH_VARIABLE}/x"),
            "study r: the folder of its recordings is ${NO_SUCH_VARIABLE}/x",
            "NO_SUCH_VARIABLE is not set",
            "export NO_SUCH_VARIABLE=",
        ),
        row(
            "a folder in a variable that is empty",
            recordings(folder="${EMPTY_VARIABLE}/x"),
            "study r: the folder of its recordings is ${EMPTY_VARIABLE}/x",
            "EMPTY_VARIABLE is empty",
            call=read_config_with_an_empty_variable,
        ),
        row("a folder that does not exist", recordings(folder="/no/such"), "line", "/no/such, does not exist"),
        row("a folder that is a file", recordings(folder="config.yaml"), "config.yaml, is a file"),
        row("a folder with none of the files", recordings(), "has none of its 1 files", "a.mat"),
        row(
            "a folder of nobody", recordings(folder="~nobody-of-this-name/x"), "~nobody-of-this-name/x, does not exist"
        ),
        row(
            "an empty path of a file", recordings(files={"S1": {"file": ""}}), f"{place} → files → S1 → file: must not"
        ),
        row(
            "a table in a variable that is not set",
            recordings(files={}, table="${NO_SUCH_VARIABLE}/list.csv"),
            "study r: the table of its recordings is ${NO_SUCH_VARIABLE}/list.csv",
        ),
        row("a table that does not exist", recordings(files={}, table="list.csv"), "there is no table", "list.csv"),
        row(
            "recordings whose names differ in capitals",
            recordings(files={"S1": {"file": "a.mat"}, "s1": {"file": "b.mat"}}),
            "files: 'S1' and 's1' differ in capitals only",
        ),
        row(
            "a recording that is called as the page of another",
            recordings(files={"S1": {"file": "a.mat"}, "S1.html": {"file": "b.mat"}}),
            "files: S1.html is the page of the recording S1",
        ),
        row("defaults in a list", recordings(defaults=[1]), f"{place} → defaults: must be a mapping", "got [1]"),
        row("files in a list", recordings(files=["a.mat"]), f"{place} → files: must be a mapping"),
        row("points of recordings", recordings(points={"zeta": [1.0]}), f"{place}: unknown key 'points'"),
        row(
            "a notebook of simulations",
            recordings(notebook="table1"),
            f"{place} → notebook: must be 'recordings'",
            "got 'table1'",
        ),
    ]


ROWS = [*_rows_of_notebooks(), *_rows_of_recordings()]
