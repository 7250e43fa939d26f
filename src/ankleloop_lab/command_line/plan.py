"""`ankleloop plan`: how long to record, from a pilot."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from ankleloop.options import check_number
from ankleloop_lab.command_line.check import check_file, find_advice
from ankleloop_lab.command_line.reading import FILE, map_file, reading_options
from ankleloop_lab.command_line.terminal import (
    echo,
    join_words,
    list_words,
    show_correction,
    show_error,
    show_next,
)
from ankleloop_lab.recordings.labels import GROUPS

HELP = "Half-width of a 95 % interval over the value: of K, B, I, G, omega_n or zeta; several times for several."
# Options that say which part of a file the pilot is, or what it is called.
PILOT_ONLY = ("case", "start", "stop", "cycle_onsets", *GROUPS)
EPILOG = """\b
Examples:
  ankleloop plan pilot.mat --torque-sign -1 --width K=5% --width G=20%
"""


def parse_widths(
    context: click.Context, option: click.Parameter, texts: tuple[str, ...]
) -> dict[str, float]:
    """Half-widths as shares, by parameter."""
    widths = {}
    for text in texts:
        try:
            name, share = text.split("=")
            whole = 100.0 if share.endswith("%") else 1.0
            number = float(share.rstrip("% ")) / whole
            widths[name] = check_number("plan", name, number, ge=1e-4, le=10)
        except ValueError:
            raise click.BadParameter(
                f"{text!r} is no parameter with a width, such as K=5% or K=0.05."
            ) from None
    return widths


width_option = partial(
    click.option,
    "--width",
    "widths",
    multiple=True,
    callback=parse_widths,
    metavar="NAME=SHARE",
)


@click.command(epilog=EPILOG)
@click.argument("file", type=FILE)
@width_option(required=True, help=HELP)
@reading_options
def plan(file: Path, widths: dict[str, float], **values: Any) -> int:
    """Plan how long to record for intervals of a width, from a pilot of 10 to 20 s.

    FILE is a pilot with the perturbation, the load and the task of the recording. It is checked as `ankleloop check`
    does, and identified by riv.
    """
    from ankleloop.methods.registry import identify
    from ankleloop_lab.experiments.duration import plan_duration

    words = click.get_current_context().obj
    recording = map_file(file, **values)
    trial, result = check_file(file, recording)
    if trial is None or result.verdict == "refused" or "riv" not in result.methods:
        reasons = " ".join(result.reasons)
        fault = "riv is not valid for this recording: record the command of the servo."
        show_error(reasons or fault)
        show_correction(find_advice(file, recording, result.remedy), words)
        return 1
    pilot = identify(trial, "riv", **result.methods["riv"])
    echo(f"\n{pilot!r}\n\n{plan_duration(pilot, widths)}")
    methods = {"riv": {"method": "riv", "options": result.methods["riv"]}}
    remedy = pilot.diagnostics.get("remedy", {})
    show_correction(find_advice(file, recording, remedy, methods), words)
    # The recording is read as its pilot was.
    for name in PILOT_ONLY:
        del values[name]
    show_next(join_words(["ankleloop", "check", "RECORDING", *list_words(values)]))
    return 0
