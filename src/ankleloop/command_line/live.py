"""`ankleloop live`: K, B and G with their intervals while the subject moves."""

from __future__ import annotations

import webbrowser
from contextlib import suppress
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

import click

from ankleloop.command_line.plan import HELP, parse_widths
from ankleloop.command_line.reading import add_options, parse_reading
from ankleloop.command_line.terminal import echo, join_words, show_next
from ankleloop.trials.channels import CHANNELS, TIME

EPILOG = """\b
Examples:
  ankleloop live --lsl ankleloop-demo
  ankleloop live --lsl Rig --position angle --torque 3 --reference command --record S1.csv
  ankleloop live growing.csv --width K=5% --width G=20%
  recorder | ankleloop live - --no-page
"""
UNITS = ("position_unit", "torque_unit", "position_sign", "torque_sign")
LOOK = 0.2  # s between two looks for a new estimate
TABLE = click.Path(exists=True, dir_okay=False, allow_dash=True, path_type=Path)
OUTPUT = click.Path(dir_okay=False, path_type=Path)


@click.command(epilog=EPILOG)
@click.argument("table", type=TABLE, required=False)
@click.option("--lsl", metavar="NAME", help="A stream of the Lab Streaming Layer.")
@partial(add_options, names=(*CHANNELS, *UNITS, TIME))
@click.option(
    "--rate",
    "sampling_rate",
    type=float,
    metavar="HZ",
    help="Sampling rate, where the source states none. The times of a table are then not read.",
)
@click.option(
    "--memory",
    type=float,
    default=20.0,
    show_default=True,
    help="Longest window of an estimate [s].",
)
@click.option(
    "--every", type=float, default=0.5, show_default=True, help="Time between estimates [s]."
)
@click.option(
    "--width",
    "widths",
    multiple=True,
    default=("K=5%",),
    show_default=True,
    callback=parse_widths,
    metavar="NAME=SHARE",
    help=HELP,
)
@click.option(
    "--page/--no-page", default=True, help="Open a page, or print a line for each estimate."
)
@click.option("--record", type=OUTPUT, help="CSV file for the samples, which identify reads.")
def live(
    table: Path | None,
    lsl: str | None,
    memory: float,
    every: float,
    widths: dict[str, float],
    page: bool,
    record: Path | None,
    **values: Any,
) -> int:
    """Show K, B and G with their intervals while the subject moves, until Ctrl+C.

    TABLE is a CSV file to which another program adds lines, or - for the same from standard input. Channels are named
    by label or by number, from 0, or found by their names, and units are those that the source states, as in files.
    Each estimate is that of riv on the last seconds.
    """
    from ankleloop.live.live_estimate import LiveEstimate
    from ankleloop.live.record import Record, find_free
    from ankleloop.live.sources import Source, StreamSource, TableSource
    from ankleloop.pages.live import LiveView
    from ankleloop.trials.files import write_csv

    source: Source
    if lsl and not table:
        source = StreamSource(lsl, parse_reading(Path(lsl), **values))
    elif table and not lsl:
        source = TableSource(table, parse_reading(table, **values))
    else:
        raise click.UsageError("name a table, or a stream by --lsl.")
    echo(
        f"{source.name}, {source.rate:g} Hz; the position is in {source.options.position_unit or 'rad'}"
    )
    for role in CHANNELS:
        echo(f"  {role:9} {source.variables[role].name}")
    try:
        estimate = LiveEstimate(source.rate, memory, every)
        estimate.enough(widths)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    recorder = Record(record, source.rate) if record else None
    view = LiveView(source, estimate, widths)
    if page:
        address = view.serve()
        echo(f"{address} is the page, on this computer alone. Ctrl+C ends the recording.")
        webbrowser.open(address)
    looked = 0.0  # when there was a look for a new estimate
    try:
        with estimate, suppress(KeyboardInterrupt):
            for samples in source:
                estimate.add(**samples)
                view.add_torque(samples["torque"])
                if recorder:
                    recorder.add(samples)
                if not page and monotonic() - looked > LOOK:
                    looked = monotonic()
                    view.show_line(echo)
        view.show_line(echo)
    finally:
        history = find_free(Path("history.csv"))
        write_csv(estimate.history, history)
        echo(f"{history} has all estimates.")
        if recorder:
            recorder.close()
            show_next(join_words(["ankleloop", "identify", *map(str, recorder.paths)]))
    return 0
