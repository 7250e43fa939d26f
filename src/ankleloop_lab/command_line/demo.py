"""`ankleloop demo`: a simulated trial in files of a laboratory, and its identification; or as a stream."""

from __future__ import annotations

import time
import webbrowser
from pathlib import Path

import click
import numpy as np

from ankleloop.quantities import SETTINGS, STIFFNESS
from ankleloop_lab.command_line.identify import identify
from ankleloop_lab.command_line.reading import FOLDER
from ankleloop_lab.command_line.terminal import echo, join_words, refuse_existing, show_next

STREAM = "ankleloop-demo"
RISE = 40  # s
LENGTH, PIECE = 120, 0.02  # s
EPILOG = """\b
Examples:
  ankleloop demo
  ankleloop demo --lsl
"""


@click.command(epilog=EPILOG)
@click.option(
    "--output",
    type=FOLDER,
    default=Path("ankleloop-demo"),
    show_default=True,
    help="Folder of all files.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Seed of the simulation.",
)
@click.option(
    "--duration",
    type=click.FloatRange(20, 600),
    default=50.0,
    show_default=True,
    help="Its length [s]; with --lsl 120.",
)
@click.option(
    "--lsl", is_flag=True, help="Send it in real time over the Lab Streaming Layer, without files."
)
@click.option("--overwrite", is_flag=True, help="Replace the files of an earlier run.")
@click.option(
    "--open/--no-open", "opens", default=True, show_default=True, help="Open the page in a browser."
)
@click.pass_context
def demo(
    context: click.Context,
    output: Path,
    seed: int,
    duration: float,
    lsl: bool,
    overwrite: bool,
    opens: bool,
) -> int:
    """Simulate a trial, write it as a laboratory would, and identify it.

    The joint pushes against a compliant load, with the settings of the paper. The trial is written as CSV, MATLAB v5
    and HDF5, and the CSV file is identified as `ankleloop identify` does. With --lsl its samples are sent as they would
    come while a subject moves, for `ankleloop live`; its stiffness rises on the way.
    """
    if lsl:
        return _stream(seed)
    import pandas as pd

    from ankleloop.quantities import QUANTITIES
    from ankleloop.simulation.simulate import simulate
    from ankleloop_lab.files.demo_files import FILE_FORMATS, write_recording
    from ankleloop_lab.recordings.recommendation import format_with_interval

    paths = {kind: output / f"demo-{kind}{suffix}" for kind, suffix in FILE_FORMATS.items()}
    if not overwrite:
        refuse_existing([*paths.values()])
    output.mkdir(parents=True, exist_ok=True)
    echo(f"Simulating {duration:g} s of a closed loop, seed {seed}.")
    trial = simulate(seed=seed, duration=duration)
    for kind, path in paths.items():
        write_recording(trial, path, kind, overwrite=overwrite)
        echo(f"  {path}")
    path = paths["csv"]
    results = output / "results"
    context.invoke(identify, files=(path,), output=results, overwrite=overwrite)
    table = pd.read_csv(results / f"{path.stem}-parameters.csv")
    for _, row in table[table["recommended"]].iterrows():
        echo(f"\n{row['label']} (95 % interval), and what was simulated:")
        for name in (*STIFFNESS, "G"):
            estimate = f"{QUANTITIES[name].label}: {format_with_interval(row, name)}"
            echo(f"  {estimate}, simulated {trial.attrs[SETTINGS[name]]:.4g}")
    page = results / f"{path.stem}.html"
    if opens and not webbrowser.open(page.absolute().as_uri()):
        show_next(f"there is no browser that could be opened: open {page} yourself.")
    show_next(join_words(["ankleloop", "study", "my-study.yaml", *map(str, paths.values())]))
    return 0


def _stream(seed: int) -> int:
    """Send a simulated trial in real time, from when somebody listens."""
    from ankleloop.simulation.simulate import simulate
    from ankleloop.trials.channels import CHANNELS
    from ankleloop_lab.live.sources import import_lsl

    lsl = import_lsl()
    stiffness = [150.0] * RISE + [195.0] * (LENGTH - RISE)
    trial = simulate(seed=seed, duration=LENGTH, variation="time", stiffness_table=stiffness)
    samples = np.column_stack([trial[name] for name in CHANNELS])
    rate = trial.attrs["sampling_rate"]
    info = lsl.StreamInfo(STREAM, "Joint", len(CHANNELS), rate, lsl.cf_double64, source_id=STREAM)
    info.set_channel_labels(list(CHANNELS))
    outlet = lsl.StreamOutlet(info)
    echo(
        f"The stream {STREAM} begins when it is read; K rises from 150 to 195 N·m/rad at {RISE} s."
    )
    show_next(f"ankleloop live --lsl {STREAM}, in another terminal")
    while not outlet.wait_for_consumers(1.0):
        pass
    end = lsl.local_clock()
    for piece in np.split(samples, round(LENGTH / PIECE)):
        end += PIECE
        time.sleep(max(0.0, end - lsl.local_clock()))
        outlet.push_chunk(piece, end)
    time.sleep(1.0)  # until all has been read
    return 0
