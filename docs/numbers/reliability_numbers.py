"""Numbers of docs/reliability.md: the table of bad inputs, and what the longer checks have counted."""

import json
import sys

from blocks import ROOT, Unavailable, block
from runs import markdown_table

RESULTS = ROOT / "results" / "reliability"
TESTS = ROOT / "tests"


def _files(folder):
    """Python files of a folder of tests, as sources of a block."""
    return [path.relative_to(ROOT).as_posix() for path in sorted((TESTS / folder).glob("*.py"))]


def _read_table():
    """Title and rows of every subject of the table of bad inputs."""
    sys.path.append(str(TESTS))
    try:
        from bad_inputs import read_table

        return list(read_table().values())
    finally:
        sys.path.remove(str(TESTS))


@block("bad-inputs", _files("bad_inputs"), imports=False)
def write_bad_inputs():
    """Counts of the table of bad inputs, and the table itself, a part that opens for each subject."""
    table = _read_table()
    header = ["subject", "rows", "errors", "warnings", "right results", "commands"]
    counts = [[title, len(rows), *_count_outcomes(rows)] for title, rows in table]
    sums = ["all", *(sum(column) for column in list(zip(*counts, strict=True))[1:])]
    parts = [markdown_table(header, [*counts, sums])]
    for title, rows in table:
        cells = [[row.wrong, f"`{row.function}`", row.outcome, _describe_message(row)] for row in rows]
        text = markdown_table(["what is wrong", "call", "outcome", "the message says"], _escape(cells))
        parts.append(f"<details><summary>{title} ({len(rows)})</summary>\n\n{text}\n\n</details>")
    return "\n\n".join(parts)


def _count_outcomes(rows):
    """Errors, warnings, right results and commands among some rows."""
    kinds = ["warning", "right result", "exit status"]
    kind_of = [next((kind for kind in kinds if row.outcome.startswith(kind)), "error") for row in rows]
    return [kind_of.count(kind) for kind in ("error", *kinds)]


def _describe_message(row):
    """What the message must contain; of a right result what it is compared with."""
    if row.right is not None:
        return row.right.__name__.strip("_").replace("_", " ")
    return " … ".join(text.strip() for text in row.says)


def _escape(cells):
    """Cells whose bars and angle brackets are no Markdown."""
    return [[cell.replace("|", "\\|").replace("<", "&lt;") for cell in row] for row in cells]


def _read_run(name, command):
    """What a command has counted in its last run, in a folder outside version control."""
    path = RESULTS / name
    if not path.exists():
        raise Unavailable(f"there is no {path.relative_to(ROOT)}: `{command}` writes it.")
    return json.loads(path.read_text(encoding="utf-8"))


@block("fuzzing", _files("fuzz"), imports=False)
def write_fuzzing():
    """What `make fuzz` has given to each reader, and what became of it."""
    run = _read_run("fuzz.json", "make fuzz")
    header = list(dict.fromkeys(key for counts in run["readers"].values() for key in counts))
    rows = [[reader, *(_show(counts.get(key, "")) for key in header)] for reader, counts in run["readers"].items()]
    date = f" of {run['date']}" if "date" in run else ""
    note = f"Run{date} with the seed {run['seed']}, {run['minutes']:g} minutes for each reader. Files that were read, "
    note += "refused with a `DataError`, or failed in another way; and how many of those refused would have ended the "
    note += "process, taken too long, or taken too much memory:"
    return f"{note}\n\n" + markdown_table(["reader", *(key.replace("_", " ") for key in header)], rows)


@block("long-tests", _files("long"), imports=False)
def write_long_tests():
    """Outcome of each test of `make test-long`, and what it has counted."""
    tests = _read_run("faults.json", "make test-long")
    rows = [_describe_test(name, entry) for name, entry in tests.items()]
    dates = sorted({entry["date"] for entry in tests.values()})
    note = f"The last run of each test, {' … '.join(sorted({dates[0], dates[-1]}))}; "
    note += f"{sum(row[2] == 'passed' for row in rows)} of {len(rows)} tests passed:"
    return f"{note}\n\n" + markdown_table(["test", "date", "outcome", "time [s]", "counts"], _escape(rows))


def _describe_test(name, entry):
    """A row about one test: its name as a sentence, and its counts."""
    counts = {key: value for key, value in entry.items() if key not in ("outcome", "seconds", "date", "reason")}
    shown = [f"{key.replace('_', ' ')} {_show(value)}" for key, value in counts.items()]
    text = name.partition("::test_")[2].replace("_", " ")
    return [
        text,
        entry["date"],
        entry["outcome"],
        f"{entry['seconds']:.0f}",
        ", ".join([*shown, *filter(None, [entry.get("reason")])]),
    ]


def _show(value):
    """A number in words; whole numbers with commas."""
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
