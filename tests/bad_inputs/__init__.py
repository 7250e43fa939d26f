"""The table of bad inputs, by subject: what the library must do with each of them.

A module holds the rows of one subject in `ROWS`, and its heading in `TITLE`. tests/unit/test_bad_inputs.py runs
all rows; docs/reliability.md shows them.
"""

from importlib import import_module

from bad_inputs.bad_input import BadInput

SUBJECTS = (
    "csv_files",
    "matlab_files",
    "hdf5_files",
    "netcdf_files",
    "trials",
    "options",
    "scores",
    "time_varying",
    "saved_files",
    "writing",
    "configs",
    "config_studies",
    "config_recordings",
    "recording_tables",
    "sweeps",
    "functions",
    "data",
    "commands",
)


def read_table() -> dict[str, tuple[str, list[BadInput]]]:
    """Heading and rows of every subject, by the name of its module."""
    modules = {name: import_module(f"bad_inputs.{name}") for name in SUBJECTS}
    return {name: (module.TITLE, list(module.ROWS)) for name, module in modules.items()}
