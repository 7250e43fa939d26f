"""The command `ankleloop`: its verbs, and the exit status of every outcome."""

from __future__ import annotations

import glob
import io
import logging
import multiprocessing
import signal
import sys
import traceback
import warnings
from collections.abc import Sequence
from importlib.metadata import entry_points
from typing import Any

import click

import ankleloop
from ankleloop.errors import DataError, ResourceError
from ankleloop_lab.command_line.check import check
from ankleloop_lab.command_line.demo import demo
from ankleloop_lab.command_line.identify import identify
from ankleloop_lab.command_line.live import live
from ankleloop_lab.command_line.plan import plan
from ankleloop_lab.command_line.terminal import (
    DATA,
    DONE,
    INTERRUPTED,
    MISTAKE,
    SOME,
    USAGE,
    echo,
    show_correction,
    show_error,
    show_warning,
)

EPILOG = f"""\b
Examples:
  ankleloop demo
  ankleloop check S1.mat --torque-sign -1
  ankleloop identify *.mat --torque-sign -1 --output results
  ankleloop study my-study.yaml *.mat
  ankleloop live --lsl ankleloop-demo

\b
Exit status:
  {DONE}    done; warnings are in the output
  {DATA}    no data can be used: refused, or no method is valid
  {USAGE}    wrong usage: an option that is missing or wrong, a file that exists
  {SOME}    of several files some can be used, and others cannot
  {MISTAKE}    a mistake in the program, or memory, disk or time that is short
  {INTERRUPTED}  interrupted
"""


@click.group(
    epilog=EPILOG,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(ankleloop.__version__, "--version", message="ankleloop %(version)s")
def commands() -> None:
    """Separate the torque of a joint into its intrinsic and reflex parts.

    Recordings are CSV, MATLAB, HDF5, NetCDF or FLB files with the position and the torque of a joint, and the
    command of the servo where it was recorded. `ankleloop COMMAND --help` describes one.
    """


for verb in (check, identify, plan, live, demo):
    commands.add_command(verb)
for entry in entry_points(group="ankleloop.commands"):  # `study` of the workflow
    commands.add_command(entry.load())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command."""
    # What the library logs is for the files of the workflow; here messages say it.
    for package in ("ankleloop", "ankleloop_lab", "ankleloop_workflow"):
        logging.getLogger(package).addHandler(logging.NullHandler())
    signal.signal(signal.SIGTERM, _end)
    if isinstance(sys.stdout, io.TextIOWrapper):  # ² and σ may be missing in an encoding of Windows
        sys.stdout.reconfigure(errors="replace")
    words = _expand_patterns(sys.argv[1:] if arguments is None else arguments)
    with warnings.catch_warnings():
        warnings.showwarning = show_warning
        try:
            return commands.main(
                args=words, prog_name="ankleloop", standalone_mode=False, obj=words
            )
        except click.ClickException as error:  # of the options
            error.show()
            show_correction(getattr(error, "remedy", {}), words)
            return USAGE
        except (click.Abort, KeyboardInterrupt):
            echo("\ninterrupted.", err=True)
            return INTERRUPTED
        except DataError as error:
            show_error(str(error))
            show_correction(error.remedy, words)
            return DATA
        except MemoryError as error:
            show_error(
                f"out of memory ({error}): take a shorter part of the recording (start, stop)."
            )
            show_correction({"start": None, "stop": None}, words)
        except ModuleNotFoundError as error:
            show_error(f'{error}: pip install "ankleloop[lab]"')
        except (ResourceError, OSError) as error:
            show_error(
                f"{error}: look after the disk, the folder and its permissions, and try again."
            )
            show_correction(getattr(error, "remedy", {}), words)
        except Exception as error:
            traceback.print_exception(error)
            show_error(
                "this is a mistake in ankleloop, not in your data: please report the lines above."
            )
    return MISTAKE


def _expand_patterns(arguments: Sequence[str]) -> list[str]:
    """Arguments with files in the place of patterns, which the shells of Windows leave to the program."""
    words = []
    for word in arguments:
        # a[0] is a part of a file, or its name.
        files = [] if "[" in word else sorted(glob.glob(word))
        words += files or [word]
    return words


def _end(number: int, _: Any) -> None:
    """End the program as an error does, so that its temporary files are removed."""
    for child in multiprocessing.active_children():
        child.kill()
    sys.exit(128 + number)
