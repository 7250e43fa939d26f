"""Points of a sweep: ranges, designs, options of methods, tables."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config_files import check_config_file
from ankleloop.studies.run_config import read_run
from ankleloop.studies.study import Study
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import text_file

TITLE = "Sweeps"

METHODS = {"pr": {"method": "pr-moesp"}, "riv": {"method": "riv"}}
STUDY = {"kind": "simulation", "notebook": None, "seed": 1, "trials": 2, "methods": METHODS}
PLACE = "config → studies → s → points"


def read_sweep(path: Path) -> dict[str, Study]:
    """Read a configuration, as the workflow does."""
    check_config_file(path)
    return read_run(yaml.safe_load(path.read_text(encoding="utf-8")), [path])[1]


row = partial(rows_of(read_sweep), error=ConfigError, shown="snakemake")


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


def parquet(**columns: Any) -> Callable[[Path], Path]:
    """A configuration with a Parquet table of points of these columns; a text is its content."""

    def make(folder: Path) -> Path:
        if "content" in columns:
            (folder / "sweep.parquet").write_text(columns["content"])
        else:
            pd.DataFrame(columns).to_parquet(folder / "sweep.parquet")
        return study(points={"table": str(folder / "sweep.parquet")})(folder)

    return make


def _rows_of_names() -> list[BadInput]:
    return [
        row(
            "a misspelt option",
            points(block_row=[12]),
            f"{PLACE}: 'block_row' is not a setting of the simulation (did you mean 'block_rows'?)",
            "nor an option of a method of the study",
        ),
        row(
            "an option of no method of the study",
            points(max_passes=[2]),
            f"{PLACE}: 'max_passes' is an option of parallel-cascade: the study has no such method; add one",
        ),
        row("text for a setting", points(reflex_gain=["ten"]), f"{PLACE} → reflex_gain=ten → reflex_gain", "got 'ten'"),
        row("a flag for a number", points(reflex_gain=[True]), f"{PLACE} → reflex_gain=True", "got True"),
        row("a fraction of an order", points(order=[2.5]), "pr → order [1]: must be a whole number", "got 2.5"),
        row("an unknown choice", points(perturbation=["prbss"]), "must be one of 'prbs' or 'pulses'; got 'prbss'"),
        row("null for a number", points(reflex_gain=[None]), f"{PLACE} → reflex_gain=None → reflex_gain", "got None"),
        row("a list for a value", points(reflex_gain=[[1, 2]]), "each value must be a single one, got [1, 2]"),
        row("a value without a list", points(reflex_gain=3), "must have a list of values, or a range"),
        row("a value that is listed twice", points(zeta=[1, 1.0]), "the point zeta=1.0 is listed twice"),
        row(
            "an option of an unknown method",
            points(**{"prr.order": [2]}),
            f"{PLACE}: 'prr.order': the study has no method 'prr' (did you mean 'pr'?); its methods: pr, riv",
        ),
        row(
            "a misspelt option of a method",
            points(**{"riv.ordre": [2]}),
            "'riv.ordre': the method riv has no option 'ordre' (did you mean 'order'?)",
        ),
        row(
            "an option under two names",
            points(**{"riv.order": [2], "order": [3]}),
            "order and riv.order are the same option of the method riv: leave one out",
        ),
        row(
            "an option that is fixed and varied",
            study(points={"order": [2, 3]}, methods=METHODS | {"pr": {"method": "pr-moesp", "options": {"order": 2}}}),
            "order: the method pr has order under options as well",
        ),
        row(
            "an option that is selected and varied",
            study(points={"riv.order": [2]}, methods={"riv": {"method": "riv", "select": {"order": [2, 3]}}}),
            "riv.order: the method riv has order under select as well",
        ),
        row(
            "an option out of range",
            points(block_rows=[12, 0]),
            f"{PLACE} → block_rows=0 → pr → block_rows",
            "got 0",
        ),
        row(
            "block rows that the order does not allow at one point",
            points(order=[2, 3], block_rows=[3, 12]),
            f"{PLACE} → block_rows=3,order=3",
            "block_rows must be larger than the order (3), got 3",
        ),
        row(
            "rates of identification whose estimates are kept",
            points(identification_rate=[100.0, 50.0]),
            f"{PLACE} → identification_rate",
            "set keep: scores",
        ),
    ]


def _rows_of_ranges() -> list[BadInput]:
    return [
        row("a range without its end", points(zeta={"start": 1, "step": 1}), f"{PLACE} → zeta: the key 'stop' is mi"),
        row("a range without a step", points(zeta={"start": 1, "stop": 2}), f"{PLACE} → zeta", "either step or count"),
        row(
            "a range with step and count",
            points(zeta={"start": 1, "stop": 2, "step": 1, "count": 2}),
            f"{PLACE} → zeta",
            "either step or count",
        ),
        row(
            "a range backwards",
            points(zeta={"start": 2, "stop": 1, "step": 0.5}),
            "zeta: stop must be at least start (2), got 1",
        ),
        row("a step down", points(zeta={"start": 2, "stop": 1, "step": -0.5}), "zeta → step", "above 0, got -0.5"),
        row(
            "a count of nothing",
            points(zeta={"start": 1, "stop": 2, "count": 0}),
            "zeta → count",
            "2 and 100000, got 0",
        ),
        row(
            "logarithms on both sides of zero",
            points(voluntary={"start": -1, "stop": 1, "count": 3, "scale": "logarithmic"}),
            "voluntary: a logarithmic scale begins above 0, got start: -1",
        ),
        row("a step of nothing", points(zeta={"start": 1, "stop": 2, "step": 0}), "zeta → step", "got 0"),
        row("a range of one value", points(zeta={"start": 1, "stop": 2, "count": 1}), "zeta → count", "got 1"),
        row(
            "logarithms of zero",
            points(voluntary={"start": 0, "stop": 1, "count": 3, "scale": "logarithmic"}),
            "voluntary: a logarithmic scale begins above 0, got start: 0",
        ),
        row(
            "a logarithmic step",
            points(voluntary={"start": 0.1, "stop": 1, "step": 3, "scale": "logarithmic"}),
            "a logarithmic range has a count in place of a step",
        ),
        row("a misspelt key of a range", points(zeta={"start": 1, "stop": 2, "stepp": 1}), "unknown key 'stepp'"),
        row("ten million values", points(zeta={"start": 0, "stop": 1, "step": 1e-7}), "has more than 100,000 values"),
        row("a range of texts", points(perturbation={"start": 0, "stop": 1, "count": 2}), "is no number and has no r"),
        row(
            "a range beyond the bounds of a setting",
            points(voluntary={"start": -1, "stop": 1, "count": 3}),
            f"{PLACE} → voluntary=-1.0 → voluntary",
            "got -1.0",
        ),
        row(
            "a step that gives fractions of whole numbers",
            points(block_rows={"start": 10, "stop": 12, "step": 0.5}),
            f"{PLACE} → block_rows=10.5 → pr → block_rows",
            "got 10.5",
        ),
        row(
            "more whole numbers than there are",
            points(block_rows={"start": 10, "stop": 12, "count": 9}),
            "the point block_rows=10 is listed twice",
        ),
    ]


def _rows_of_designs() -> list[BadInput]:
    return [
        row("an unknown design", design(design="sobl"), f"{PLACE} → design: must be one of", "got 'sobl'"),
        row("a design without a seed", study(points={"design": "sobol"}), f"{PLACE}: the key 'count' is missing"),
        row(
            "a Sobol design whose count is no power of two",
            design(count=100),
            f"{PLACE}: the count of a Sobol design is a power of two, which fills space evenly: 64 or 128, got 100",
        ),
        row(
            "a logarithmic design from zero",
            design(parameters={"voluntary": {"start": 0, "stop": 1, "scale": "logarithmic"}}),
            f"{PLACE} → parameters → voluntary: a logarithmic scale begins above 0",
        ),
        row(
            "limits beyond the bounds of a setting",
            design(parameters={"voluntary": {"start": -1, "stop": 0}}),
            f"{PLACE} → voluntary=-",
            "must be between 0 and",
        ),
        row("a design of no points", design(count=0), f"{PLACE} → count", "got 0"),
        row("a design of a million points", design(count=10**6), f"{PLACE} → count", "100000"),
        row("a design of nothing", design(parameters={}), f"{PLACE} → parameters: must not be empty"),
        row(
            "a number as limits", design(parameters={"zeta": 1}), "must have limits (start, stop) or a list", "zeta: 1"
        ),
        row("equal limits", design(parameters={"zeta": {"start": 1, "stop": 1}}), "zeta: stop must be above start"),
        row(
            "a step in a design", design(parameters={"zeta": {"start": 1, "stop": 2, "step": 1}}), "unknown key 'step'"
        ),
        row("a misspelt parameter", design(parameters={"zetta": [1]}), "'zetta' is not a setting of the simulation"),
        row(
            "a design that gives a point twice",
            design(parameters={"block_rows": {"start": 10, "stop": 12}}),
            "is listed twice",
        ),
    ]


def _rows_of_tables() -> list[BadInput]:
    return [
        row("no table of points", study(points={"table": "nowhere.csv"}), "there is no table", "nowhere.csv"),
        row("keys beside a table", study(points={"table": "a.csv", "zeta": [1]}), f"{PLACE}: zeta stands beside table"),
        row("a setting beside a design", design(zeta=[1]), f"{PLACE}: zeta stands beside design: points have one form"),
        row("a header without rows", table("zeta"), "sweep.csv has no rows"),
        row("semicolons", table("zeta;voluntary", "1;0"), "line 1: the columns are separated by semicolons"),
        row("two columns of one name", table("zeta,zeta", "1,2"), "line 1: 2 columns are called 'zeta'"),
        row("an unknown column", table("zetta", "1"), "sweep.csv", "'zetta' is not a setting of the simulation"),
        row("a number out of range in a row", table("zeta", "1", "-1"), "sweep.csv, line 3 → zeta", "got -1"),
        row("text for a number", table("zeta", "1", "one"), "sweep.csv, line 3 → zeta", "got 'one'"),
        row("nan for a number", table("zeta", "nan"), "sweep.csv, line 2 → zeta", "got 'nan'"),
        row("a fraction of a block row", table("block_rows", "12.5"), "line 2 → pr → block_rows", "got 12.5"),
        row("an empty cell", table("zeta,delay", "1,0.04", ",0.05"), "line 3: the cell of the column 'zeta' is empty"),
        row(
            "a column without values",
            table("zeta,delay", "1,", "2,"),
            "line 2: the cell of the column 'delay' is empty",
        ),
        row("a flag that is none", table("closed_loop", "maybe"), "line 2 → closed_loop: must be true or false"),
        row("decimal commas", table("zeta", '"0,5"'), "sweep.csv, line 2 → zeta", "got '0,5'"),
        row("null for a number in a row", table("zeta", "null"), "sweep.csv, line 2 → zeta", "got 'null'"),
        row("an option of an unused method in a table", table("max_passes", "2"), "is an option of parallel-cascade"),
        row("a row cut off", table("zeta,delay", "1,0.04", "1"), "line 3: the row has 1 cells of 2"),
        row("a row twice", table("zeta", "1", "2", "1.0"), "line 4: the point zeta=1.0 is in", "line 2 already"),
        row(
            "settings that do not go together in a row",
            table("duration,recording_rate", "50,1000", "0.0015,1000"),
            "line 3: duration × recording_rate must be a whole number",
        ),
        row("text that is called Parquet", parquet(content="zeta\n1\n"), "sweep.parquet: the file cannot be read as"),
        row("a Parquet row out of range", parquet(zeta=[1.0, -1.0]), "sweep.parquet, row 2 → zeta", "got -1.0"),
        row("text in Parquet", parquet(zeta=["one"]), "sweep.parquet, row 1 → zeta", "got 'one'"),
        row("a Parquet row twice", parquet(zeta=[1.0, 2.0, 1.0]), "row 3: the point zeta=1.0 is in", "row 1 already"),
        row("Parquet without rows", parquet(zeta=[]), "sweep.parquet has no rows"),
        row("an empty Parquet cell", parquet(zeta=[1.0, None]), "sweep.parquet, row 2, column zeta: there is no value"),
    ]


def _rows_of_pictures() -> list[BadInput]:
    def shown(**keys: Any) -> Callable[[Path], Path]:
        return study(points={"zeta": [0.5, 1.0]}, notebook="sweep", sweep=keys)

    place = "config → studies → s → sweep"
    return [
        row("an axis that does not vary", shown(axes=["zetta"]), f"{place}: axes", "(did you mean 'zeta'?)"),
        row("an unknown quantity", shown(quantities=["vaf_net_tru"]), f"{place}: quantities", "'vaf_net_true'"),
        row("a quantity that is not scored", shown(quantities=["vaf_reflex_measured"]), "it has vaf_net_measured"),
        row("a method minus itself", shown(difference=["riv", "riv"]), f"{place}: difference: 'riv' is listed twice"),
        row("an unknown method", shown(methods=["rvi"]), f"{place}: methods: there is no method 'rvi'", "'riv'"),
    ]


def _rows_of_jobs() -> list[BadInput]:
    place = "config → studies → s"
    return [
        row("jobs of no time", study(job_minutes=0), f"{place} → job_minutes", "got 0"),
        row(
            "a million jobs",
            study(job_minutes=1e-3, points={"zeta": {"start": 1, "stop": 2, "count": 100}}, trials=100_000),
            "chunks are more than 100,000: increase job_minutes",
        ),
        row(
            "a study that is the table of another",
            text_file("config.yaml", yaml.safe_dump({"studies": {"s": STUDY, "s-trials": STUDY}})),
            "config: studies: s-trials is the table of all trials of s: choose another name",
        ),
        row("results of which half are kept", study(keep="half"), f"{place} → keep: must be one of", "got 'half'"),
    ]


ROWS: list[BadInput] = [
    *_rows_of_names(),
    *_rows_of_ranges(),
    *_rows_of_designs(),
    *_rows_of_tables(),
    *_rows_of_pictures(),
    *_rows_of_jobs(),
]
