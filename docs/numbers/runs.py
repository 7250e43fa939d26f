"""Results that the documentation reports: studies of the configuration, made by the workflow where they are missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import yaml
from blocks import ROOT, Unavailable

from ankleloop.recordings.files import load_recording
from ankleloop.replication.trial_tables import read_trial_table
from ankleloop.signals.vaf import confidence_margin

RESULTS = ROOT / "results"
EXAMPLE = "config/recordings.example.yaml"


def make(*targets, arguments=()):
    """Make files of the workflow."""
    command = [Path(sys.executable).with_name("snakemake"), "--cores", str(os.cpu_count()), "--quiet", "all"]
    subprocess.run([*command, *arguments, "--", *targets], cwd=ROOT, check=True)


def read_study(name):
    """One row for each estimate of a simulated study: its parameters and its VAFs."""
    # Not the tables of chunks: those of an older division into chunks may stand beside them.
    path = f"results/tables/{name}-trials.parquet"
    make(path)
    return read_trial_table(ROOT / path).astype({"point": str, "method": str})


def copy_figure(name, target, *, arguments=()):
    """Copy a figure of the workflow to the documentation."""
    make(f"results/figures/{name}.png", arguments=arguments)
    shutil.copyfile(RESULTS / "figures" / f"{name}.png", ROOT / "docs" / target)


def recordings_folder():
    """Folder of the real recordings; where the environment variable that names it is not set, it is unavailable."""
    folder = os.environ.get("ANKLELOOP_RECORDINGS")
    if not folder:
        raise Unavailable("the environment variable ANKLELOOP_RECORDINGS names no folder of recordings.")
    return Path(folder)


def read_recordings():
    """The real recordings by name, read as config/recordings.example.yaml says."""
    folder = recordings_folder()
    study = yaml.safe_load((ROOT / EXAMPLE).read_text(encoding="utf-8"))["studies"]["recordings"]
    mappings = {name: {**study["defaults"], **mapping} for name, mapping in study["files"].items()}
    return {name: load_recording(folder / mapping["file"], mapping) for name, mapping in mappings.items()}


def mean(values, spec=".1f"):
    """Mean of a sample with half of its 95 % interval as text."""
    values = pd.Series(values).dropna()
    return f"{values.mean():{spec}} ± {confidence_margin(values.std(), values.size):{spec}}"


def markdown_table(header, rows):
    """A table as Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
