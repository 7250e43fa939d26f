"""`ankleloop plan`: how long to record, from a pilot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ankleloop.command_line.check import check_file, show_reading
from ankleloop.command_line.reading import map_file, reading_options
from ankleloop.command_line.terminal import echo, format_table, show_error

EPILOG = """\b
Examples:
  ankleloop plan pilot.csv --width K=5%
  ankleloop plan pilot.mat --torque-sign -1 --width K=5% --width G=20%

Exit status: 0 done; 1 the pilot is refused, or no record reaches a width; 2 wrong usage.
"""


def _parse_widths(context: click.Context, option: click.Parameter, texts: tuple[str, ...]) -> dict[str, float]:
    """Half-widths as shares, by parameter."""
    widths = {}
    for text in texts:
        name, _, share = text.partition("=")
        try:
            widths[name.strip()] = float(share.rstrip("% ")) / (100.0 if share.endswith("%") else 1.0)
        except ValueError:
            raise click.BadParameter(f"{text!r} is no parameter with a width, such as K=5% or K=0.05.") from None
    return widths


@click.command(epilog=EPILOG)
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--width",
    "widths",
    multiple=True,
    required=True,
    callback=_parse_widths,
    metavar="NAME=SHARE",
    help="Half-width of the 95 % interval of a parameter (K, B, I, G, omega_n, zeta) over its value; several times for "
    "several.",
)
@reading_options
def plan(file: Path, widths: dict[str, float], **values: Any) -> int:
    """Plan how long to record for intervals of a width, from a pilot of 10 to 20 s.

    FILE is a pilot with the perturbation, the load and the task of the recording. It is checked as `ankleloop check`
    does, and identified by riv.
    """
    from ankleloop.errors import DataError
    from ankleloop.experiments.duration import plan_duration
    from ankleloop.methods.registry import identify
    from ankleloop.quantities import QUANTITIES

    reading = map_file(file, **values)
    trial, result = check_file(file, reading)
    show_reading(file, reading, trial)
    if result.verdict == "refused" or "riv" not in result.methods:
        show_error(" ".join(result.reasons) or "riv is not valid for this recording: record the command of the servo.")
        return 1
    pilot = identify(trial, "riv", **result.methods["riv"])
    try:
        planned = plan_duration(pilot, widths)
    except ValueError as error:
        raise error if isinstance(error, DataError) else click.UsageError(str(error)) from None
    values = {**pilot.stiffness, **pilot.reflex}
    rows = [["", "pilot (95 % interval)", "to be within", "takes"]]
    for name, seconds in planned.needed.items():
        low, high = pilot.intervals[name]
        interval = f"{values[name]:.4g} ({low:.4g} … {high:.4g})"
        rows.append([QUANTITIES[name].label, interval, f"±{100 * widths[name]:g} %", f"{seconds:.0f} s"])
    low, high = planned.interval
    echo(f"\n{format_table(rows)}\n")
    echo(f"Record {planned.seconds:.0f} s ({low:.0f} … {high:.0f} s): {QUANTITIES[planned.parameter].symbol} decides.")
    return 0
