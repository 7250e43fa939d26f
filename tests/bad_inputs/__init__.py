"""The table of bad inputs, by subject: what the library must do with each of them.

There is a row for each class of fault, and each container or call where a laboratory or the author of a configuration
meets it. A module holds the rows of one subject in `ROWS`; tests/unit/test_bad_inputs.py runs them.
"""

from importlib import import_module

from bad_inputs.bad_input import BadInput

SUBJECTS = (
    "csv_files",
    "matlab_files",
    "hdf5_files",
    "netcdf_files",
    "flb_files",
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
    "experiments",
    "data",
    "commands",
)


def read_table() -> dict[str, list[BadInput]]:
    """Rows of every subject, by the name of its module."""
    return {name: list(import_module(f"bad_inputs.{name}").ROWS) for name in SUBJECTS}
