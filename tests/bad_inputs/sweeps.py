"""Points of a sweep: ranges, designs, options of methods, tables."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from ankleloop.studies.checking import ConfigError, check_config_file
from ankleloop.studies.run_config import read_run
from ankleloop.studies.study import Study
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import text_file

METHODS = {"pr": {"method": "pr-moesp"}, "riv": {"method": "riv"}}
STUDY = {"kind": "simulation", "notebook": None, "seed": 1, "trials": 2, "methods": METHODS}
PLACE = "config → studies → s → points"


def read_sweep(path: Path) -> dict[str, Study]:
    """Read a configuration, as the workflow does."""
    check_config_file(path)
    return read_run(yaml.safe_load(path.read_text(encoding="utf-8")), [path])[1]


row = partial(rows_of(read_sweep), error=ConfigError)


def study(**keys: Any) -> Callable[[Path], Path]:
    """A configuration whose study has other keys."""
    return text_file("config.yaml", yaml.safe_dump({"studies": {"s": {**STUDY, **keys}}}, allow_unicode=True))


def points(**names: Any) -> Callable[[Path], Path]:
    """A configuration whose study has these points."""
    return study(points=names)


def design(**keys: Any) -> Callable[[Path], Path]:
    """A configuration with a design, some keys of which are others."""
    good = {"design": "sobol", "count": 8, "seed": 1, "parameters": {"zeta": {"start": 0.5, "stop": 1.0}}}
    return study(points={**good, **keys})


def table(*lines: str) -> Callable[[Path], Path]:
    """A configuration with a table of points of these lines."""

    def make(folder: Path) -> Path:
        (folder / "sweep.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return study(points={"table": str(folder / "sweep.csv")})(folder)

    return make


def _rows_of_names() -> list[BadInput]:
    return [
        row(
            "a misspelt option",
            points(block_row=[12]),
            f"{PLACE}: 'block_row' is not a setting of the simulation (did you mean 'block_rows'?)",
            "nor an option of a method of the study",
        ),
        row("a value that is listed twice", points(zeta=[1, 1.0]), "the point zeta=1.0 is listed twice"),
        row(
            "an option that is fixed and varied",
            study(points={"order": [2, 3]}, methods=METHODS | {"pr": {"method": "pr-moesp", "options": {"order": 2}}}),
            "order: the method pr has order under options or select as well",
        ),
        row(
            "block rows that the order does not allow at one point",
            points(order=[2, 3], block_rows=[3, 12]),
            "methods → pr → options: at the point block_rows=3,order=3",
            "block_rows must be larger than the order (3), got 3",
        ),
    ]


def _rows_of_ranges() -> list[BadInput]:
    return [
        row(
            "logarithms on both sides of zero",
            points(voluntary={"start": -1, "stop": 1, "count": 3, "scale": "logarithmic"}),
            "voluntary: a logarithmic scale begins above 0, got start: -1",
        ),
    ]


def _rows_of_designs() -> list[BadInput]:
    return [
        row(
            "a Sobol design whose count is no power of two",
            design(count=100),
            f"{PLACE}: the count of a Sobol design is a power of two: 64 or 128, got 100",
        ),
    ]


def _rows_of_tables() -> list[BadInput]:
    return [
        row("no table of points", study(points={"table": "nowhere.csv"}), "nowhere.csv: the file cannot be read"),
        row("an unknown column", table("zetta", "1"), PLACE, "'zetta' is not a setting of the simulation"),
        row(
            "an empty cell",
            table("zeta,delay", "1,0.04", ",0.05"),
            "sweep.csv, line 3",
            "zeta: must be a finite number",
        ),
        row(
            "settings that do not go together in a row",
            table("duration,recording_rate", "50,1000", "0.0015,1000"),
            "sweep.csv, line 3",
            "duration × recording_rate must be a whole number",
        ),
    ]


def _rows_of_pictures() -> list[BadInput]:
    def shown(**keys: Any) -> Callable[[Path], Path]:
        return study(points={"zeta": [0.5, 1.0]}, notebook="sweep", sweep=keys)

    place = "config → studies → s → sweep"
    return [
        row("an axis that does not vary", shown(axes=["zetta"]), f"{place}: axes", "(did you mean 'zeta'?)"),
    ]


ROWS: list[BadInput] = [
    *_rows_of_names(),
    *_rows_of_ranges(),
    *_rows_of_designs(),
    *_rows_of_tables(),
    *_rows_of_pictures(),
]
