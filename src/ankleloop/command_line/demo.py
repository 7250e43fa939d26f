"""`ankleloop demo`: a simulated trial in every file format, and its identification."""

from __future__ import annotations

import shlex
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ankleloop.command_line.check import show_reading
from ankleloop.command_line.identify import identify_recording, show_results
from ankleloop.command_line.outputs import check_outputs
from ankleloop.command_line.reading import map_file
from ankleloop.command_line.terminal import echo, format_table, show_next, show_progress

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

CHANNELS = ("position", "torque", "reference")
READ = (*CHANNELS, "position_unit")
PARAMETERS = {"K": "stiffness", "B": "viscosity", "I": "inertia", "G": "reflex_gain"}  # with settings of a simulation
EPILOG = """\b
Examples:
  ankleloop demo
  ankleloop demo --output my-demo --seed 7 --no-open

Exit status: 0 done; 2 wrong usage, for example files that exist.
"""


@click.command(epilog=EPILOG)
@click.option(
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("ankleloop-demo"),
    show_default=True,
    help="Folder of the files and of the results.",
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Seed of the simulation.")
@click.option(
    "--duration", type=click.FloatRange(20, 600), default=50.0, show_default=True, help="Length of the trial [s]."
)
@click.option("--overwrite", is_flag=True, help="Replace the files of an earlier run.")
@click.option("--open/--no-open", "opens", default=True, show_default=True, help="Open the page in a browser.")
def demo(output: Path, seed: int, duration: float, overwrite: bool, opens: bool) -> int:
    """Simulate a trial, write it in every file format, and identify it.

    The joint pushes against a compliant load, with the settings of the paper. The trial is written as CSV, MATLAB v5
    and v7.3, HDF5 and NetCDF; each file is read again and compared, and the CSV file is identified as
    `ankleloop identify` does.
    """
    from ankleloop.simulation.simulate import simulate

    echo(f"Simulating {duration:g} s of a closed loop, seed {seed}.")
    trial = simulate(seed=seed, duration=duration)
    files = _write_files(trial, output, overwrite=overwrite)
    path = files[0]
    reading = map_file(path)
    echo()
    show_reading(path, reading)
    with show_progress():
        table, page = identify_recording(path, reading, output / "results", overwrite=overwrite)
    echo()
    status = show_results(table, page)
    echo(f"\n{_compare(trial, table)}")
    if opens and not webbrowser.open(page.absolute().as_uri()):
        show_next(f"there is no browser that could be opened: open {page} yourself.")
    show_next(*(shlex.join(["ankleloop", verb, str(path)]) for verb in ("check", "identify")))
    show_next(shlex.join(["ankleloop", "study", "my-study.yaml", *map(str, files)]))
    return status


def _write_files(trial: xr.Dataset, folder: Path, *, overwrite: bool) -> list[Path]:
    """Write a trial in every format, read it again, and compare."""
    import numpy as np

    from ankleloop.trials.readers import read_trial
    from ankleloop.trials.recording_files import FILE_FORMATS, write_recording

    paths = {kind: folder / f"demo-{kind}{suffix}" for kind, (suffix, _) in FILE_FORMATS.items()}
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise click.UsageError(f"{folder}: cannot be made ({error.strerror}): name another one by --output.") from None
    check_outputs(paths.values(), "--overwrite replaces it, --output names another folder.", overwrite=overwrite)
    for kind, path in paths.items():
        write_recording(trial, path, kind, overwrite=overwrite)
        copy = read_trial(path, **map_file(path).recording.model_dump(include={*READ}))
        errors = [float(np.abs(copy[name] - trial[name]).max() / trial[name].std()) for name in CHANNELS]
        echo(f"  {path}  read again: the largest difference is {max(errors):.1g} of a standard deviation")
    return list(paths.values())


def _compare(trial: xr.Dataset, table: pd.DataFrame) -> str:
    """True parameters of a simulated trial beside those of the recommended method."""
    from ankleloop.quantities import QUANTITIES
    from ankleloop.recordings.recommendation import format_with_interval

    chosen = table[table["recommended"]]
    if chosen.empty:
        return "No method is recommended for this trial."
    row = chosen.iloc[0]
    rows = [
        [QUANTITIES[name].label, f"{trial.attrs[setting]:.4g}", format_with_interval(row, name)]
        for name, setting in PARAMETERS.items()
    ]
    return format_table([["", "simulated", f"{row['label']} (95 % interval)"], *rows])
