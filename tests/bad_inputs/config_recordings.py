"""Studies of recordings of the configuration, and notebooks of studies."""

from typing import Any

from bad_inputs.bad_input import BadInput
from bad_inputs.config_inputs import recordings, row, study


def _rows_of_notebooks() -> list[BadInput]:
    """What a notebook needs of its study, which would otherwise be found after all trials."""
    place = "config → studies → s → notebook"

    def notebook(name: str, **keys: Any):
        return study(notebook=name, **keys)

    return [
        row("Figure 4 of one point", notebook("figure4"), f"{place}: figure4 needs one setting", "got none"),
        row(
            "efficiency without intervals of the delay",
            notebook("efficiency"),
            "needs a method riv with the option delay: n",
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
            "cycles and a schedule",
            recordings(files={"S1": {"file": "a.mat", "cycle_onsets": "phase", "schedule": "angle"}}),
            f"{place} → files → S1",
            "cycle_onsets and schedule exclude each other",
        ),
        row(
            "a folder in a variable that is not set",
            recordings(folder="${NO_SUCH_VARIABLE}/x"),
            "study r: the folder of its recordings is ${NO_SUCH_VARIABLE}/x",
            "NO_SUCH_VARIABLE is not set",
            "export NO_SUCH_VARIABLE=",
        ),
        row("a folder that does not exist", recordings(folder="/no/such"), "line", "files exists", "/no/such/a.mat"),
        row(
            "recordings whose names differ in capitals",
            recordings(files={"S1": {"file": "a.mat"}, "s1": {"file": "b.mat"}}),
            "files: 'S1' and 's1' differ in capitals only",
        ),
    ]


ROWS = [*_rows_of_notebooks(), *_rows_of_recordings()]
