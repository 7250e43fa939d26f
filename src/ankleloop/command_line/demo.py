"""`ankleloop demo`: a simulated trial in every file format, and its identification."""

from __future__ import annotations

import shlex
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ankleloop.command_line.check import show_reading
from ankleloop.command_line.outputs import check_outputs
from ankleloop.command_line.reading import map_file
from ankleloop.command_line.terminal import echo, format_table, show_next, show_progress

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

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
    and v7.3, HDF5 and NetCDF, and the CSV file is identified as `ankleloop identify` does.
    """
    from ankleloop.command_line import analysis
    from ankleloop.simulation.simulate import simulate
    from ankleloop.trials.recording_files import FILE_FORMATS, write_recording

    paths = {kind: output / f"demo-{kind}{suffix}" for kind, (suffix, _) in FILE_FORMATS.items()}
    check_outputs(output, [path.name for path in paths.values()], analysis.REMEDY, overwrite=overwrite)
    echo(f"Simulating {duration:g} s of a closed loop, seed {seed}.")
    trial = simulate(seed=seed, duration=duration)
    for kind, file in paths.items():
        write_recording(trial, file, kind, overwrite=overwrite)
        echo(f"  {file}")
    path = next(iter(paths.values()))
    reading = map_file(path)
    echo()
    show_reading(path, reading)
    study = analysis.make_study(path.stem, path, reading.recording)
    with show_progress():
        table, page = analysis.identify_recording(study, output / "results", overwrite=overwrite)
    echo()
    analysis.show_results(table, page)
    echo(f"\n{_compare(trial, table)}")
    if opens and not webbrowser.open(page.absolute().as_uri()):
        show_next(f"there is no browser that could be opened: open {page} yourself.")
    show_next(*(shlex.join(["ankleloop", verb, str(path)]) for verb in ("check", "identify")))
    show_next(shlex.join(["ankleloop", "study", "my-study.yaml", *map(str, paths.values())]))
    return 0


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
