"""The command `ankleloop`: its verbs, and the exit status of every outcome."""

from __future__ import annotations

import errno
import logging
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Sequence
from importlib import import_module
from types import FrameType
from typing import Any

import click

import ankleloop
from ankleloop.command_line.terminal import echo, show_error, show_warning
from ankleloop.errors import DataError, ResourceError

DONE, DATA, USAGE, MISTAKE, INTERRUPTED = 0, 1, 2, 3, 130
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# The modules of the verbs are imported when they are used, because `ankleloop --help` needs none of them.
VERBS = {
    "check": "Check what can be identified from a recording.",
    "identify": "Identify recordings: pages, a table and the estimates.",
    "plan": "Plan how long to record, from a pilot.",
    "study": "Write a commented configuration of a study.",
    "demo": "Simulate a trial, write it in every file format, and identify it.",
}
EPILOG = f"""\b
Examples:
  ankleloop demo
  ankleloop check S1.mat --torque-sign -1
  ankleloop identify *.mat --torque-sign -1 --output results
  ankleloop study my-study.yaml *.mat

\b
Exit status:
  {DONE}    done; warnings are in the output
  {DATA}    the data cannot be used: refused, or no method is valid
  {USAGE}    wrong usage: an option that is missing or wrong, a file that exists
  {MISTAKE}    a mistake in the program, or memory, disk or time that is short
  {INTERRUPTED}  interrupted
"""


class _Verbs(click.Group):
    """Verbs whose modules are imported when they are used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the verbs."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Command of a verb; None if there is none."""
        return getattr(import_module(f"ankleloop.command_line.{cmd_name}"), cmd_name) if cmd_name in VERBS else None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of the verbs without importing them."""
        with formatter.section("Verbs"):
            formatter.write_dl(list(VERBS.items()))


@click.group(
    cls=_Verbs,
    epilog=EPILOG,
    subcommand_metavar="VERB ...",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(ankleloop.__version__, "--version", message="ankleloop %(version)s")
def commands() -> None:
    """Separate the torque of a joint into its intrinsic and reflex parts.

    Recordings are CSV, MATLAB (v5, v7.3), HDF5 or NetCDF files with the position and the torque of a joint, and the
    command of the servo where it was recorded. `ankleloop VERB --help` describes a verb.
    """


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command."""
    for name in THREADS:  # before numpy is imported; as in the jobs of the workflow, for equal bits
        os.environ.setdefault(name, "1")
    # What the library logs is for the files of the workflow; here messages say it.
    logging.getLogger("ankleloop").addHandler(logging.NullHandler())
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminate)
    words = list(sys.argv[1:] if arguments is None else arguments)
    with warnings.catch_warnings():
        warnings.showwarning = show_warning
        try:
            status: Any = commands.main(args=words, prog_name="ankleloop", standalone_mode=False, obj=words)
        except click.exceptions.Exit as end:
            return end.exit_code
        except click.ClickException as error:  # of the options
            error.show()
            return USAGE
        except (click.Abort, KeyboardInterrupt):
            echo(err=True)
            show_error("interrupted.")
            return INTERRUPTED
        except DataError as error:
            show_error(str(error), words)
            return DATA
        except Exception as error:
            return _report_mistake(error, words)
    return status if isinstance(status, int) else DONE


def _terminate(number: int, frame: FrameType | None) -> None:
    """End the program as an error does, so that its temporary files are removed."""
    raise SystemExit(128 + number)


def _report_mistake(error: Exception, words: Sequence[str]) -> int:
    """Show an error that is not about the data or the usage."""
    if isinstance(error, MemoryError):
        text = f"out of memory ({error}): take a shorter part of the recording (start, stop), or free memory."
    elif isinstance(error, ResourceError):
        text = str(error)
    elif isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        place = error.filename or "the folder of temporary files (TMPDIR) or of the results"
        text = f"{place}: the disk is full ({error.strerror}): free space there, and run the command again."
    else:
        traceback.print_exception(error)
        text = "this is a mistake in ankleloop, not in your data: please report the lines above."
    show_error(text, words)
    return MISTAKE
