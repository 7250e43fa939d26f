"""`ankleloop live`: K, B and G with their intervals while the subject moves."""

from __future__ import annotations

import webbrowser
from contextlib import suppress
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

import click

from ankleloop.trials.channels import CHANNELS
from ankleloop_lab.command_line.plan import width_option
from ankleloop_lab.command_line.reading import add_options, parse_reading
from ankleloop_lab.command_line.terminal import echo, join_words, show_next

EPILOG = """\b
Examples:
  ankleloop live --lsl ankleloop-demo
  ankleloop live --lsl Rig --position angle --torque 3 --reference command --record S1.csv
  ankleloop live growing.csv --width K=5% --width G=20%
  recorder | ankleloop live - --no-page
"""
OPTIONS = (
    *CHANNELS,
    "position_unit",
    "torque_unit",
    "reference_unit",
    "position_sign",
    "torque_sign",
    "time",
    "sampling_rate",
    "apparatus",
)
PERIOD = 0.5  # s between two lines, as between two estimates


@click.command(epilog=EPILOG)
@click.argument(
    "table",
    type=click.Path(exists=True, dir_okay=False, allow_dash=True, path_type=Path),
    required=False,
)
@click.option("--lsl", metavar="NAME", help="A stream of the Lab Streaming Layer.")
@partial(add_options, names=OPTIONS)
@click.option(
    "--memory",
    type=click.FloatRange(10, 3600),
    default=20.0,
    show_default=True,
    help="Longest window of an estimate [s].",
)
@width_option(
    default=["K=5%"],
    show_default=True,
    help="Half-width of a 95 % interval over K, B, I or G that is enough; several times for several.",
)
@click.option("--no-page", is_flag=True, help="Print a line for each estimate in place of a page.")
@click.option(
    "--record",
    type=click.Path(dir_okay=False, path_type=Path),
    help="CSV file for the samples, which identify reads.",
)
def live(
    table: Path | None,
    lsl: str | None,
    memory: float,
    widths: dict[str, float],
    no_page: bool,
    record: Path | None,
    **values: Any,
) -> int:
    """Show K, B and G with their intervals while the subject moves, until Ctrl+C.

    TABLE is a CSV file to which another program adds lines, or - for the same from standard input. Channels are named
    by label or by number, from 0, or found by their names, and units are those that the source states, as in files.
    Each estimate is that of riv on the last seconds.
    """
    from ankleloop.joint.estimate_files import load_estimate
    from ankleloop.trials.files import write_csv
    from ankleloop_lab.live.live_estimate import LiveEstimate
    from ankleloop_lab.live.record import Record, find_free
    from ankleloop_lab.live.sources import Source, StreamSource, TableSource
    from ankleloop_lab.pages.live import LiveView

    if bool(lsl) == bool(table):
        raise click.UsageError("name a table, or a stream by --lsl.")
    place = table or Path(str(lsl))
    options = parse_reading(place, **values)
    source: Source = StreamSource(lsl, options) if lsl else TableSource(place, options)
    echo(source.summary)
    recorder = Record(record, source.rate) if record else None
    apparatus = load_estimate(options.apparatus) if options.apparatus else None
    estimate = LiveEstimate(
        source.rate, memory, jitter=source.jitter, record=recorder, apparatus=apparatus
    )
    estimate.enough(widths)
    view = LiveView(source, estimate, widths)
    if not no_page:
        address = view.serve()
        echo(f"{address} is the page, on this computer alone. Ctrl+C ends the recording.")
        webbrowser.open(address)
    shown = monotonic()  # when there was the last line
    try:
        with estimate, suppress(KeyboardInterrupt):
            for samples in source:
                estimate.add(**samples)
                if no_page and monotonic() - shown > PERIOD:
                    shown = monotonic()
                    echo(view.render("live_line.txt.j2"))
        echo(view.render("live_line.txt.j2"))
    finally:
        history = find_free(Path("history.csv"))
        write_csv(estimate.history, history)
        echo(f"{history} has all estimates.")
        if recorder:
            recorder.close()
            show_next(join_words(["ankleloop", "identify", *map(str, recorder.paths)]))
    return 0
