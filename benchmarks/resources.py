"""Time of jobs: runs small studies through the workflow and fits the times that Snakemake measures.

The result, src/ankleloop/studies/resources.json, is what `ankleloop.studies.resources` computes the time of a job from.
The studies differ in method, number of trials and length, so that a non-negative least-squares fit separates the start
of a job, a trial and a sample.

Run by: python benchmarks/resources.py
"""

import json
import math
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scaling import make_sweep
from scipy.optimize import nnls
from tools import run_workflow

from ankleloop import METHODS, simulate
from ankleloop.studies.resources import BLOCK_ROWS, MEASURED

RATE, IDENTIFICATION_RATE = 1000.0, 100.0  # samples of a second
# Trials and duration [s] of the chunks. Snakemake looks twice a second at a job that takes less than 15 s.
SIZES = ((4, 20.0), (400, 20.0), (200, 60.0))
RECORDINGS, RECORDED = 3, 60.0  # number and duration of recordings [s]
VARIANTS = {name: {"method": name} for name in METHODS}
VARIANTS["riv-delay"] = {"method": "riv", "options": {"delay": None}}
VARIANTS["wide"] = {"method": "pr-moesp", "options": {"block_rows": 2 * BLOCK_ROWS}}
GROUPS = {name: [name] for name in VARIANTS} | {"all": list(VARIANTS)}  # methods of a study


def make_recordings(folder):
    """A study of recordings, whose files are simulated trials."""
    files = {}
    for number in range(RECORDINGS):
        trial = simulate(seed=number, duration=RECORDED)
        files[f"r{number}"] = {"file": f"{number}.csv"}
        columns = {name: trial[name].values for name in ("position", "torque", "reference")}
        pd.DataFrame(columns).to_csv(folder / f"{number}.csv", index=False)
    study = {
        "kind": "recordings",
        "notebook": None,
        "folder": str(folder),
        "recordings_per_chunk": RECORDINGS,
    }
    study |= {"defaults": {"sampling_rate": RATE, "reference": "reference"}, "files": files}
    return study | {"methods": {name: {"method": name} for name in ("pr-moesp", "riv")}}


def measure_jobs(folder, sizes=SIZES):
    """Time of each job and what it is made of."""
    studies, contents = {"recorded": make_recordings(folder)}, {}
    contents["recordings/recorded"] = {"start": 1.0, "recording": RECORDINGS}
    for group, names in GROUPS.items():
        for trials, duration in sizes:
            study = f"{group}-{trials}-{duration:g}"
            studies[study] = make_sweep(
                {"reflex_gain": [13.0]}, trials, [], simulation={"duration": duration}
            )
            studies[study] |= {
                "trials_per_chunk": 1000,
                "methods": {name: VARIANTS[name] for name in names},
            }
            samples = trials * duration * RATE
            contents[f"simulate/{study}"] = {
                "start": 1.0,
                "simulated trial": trials,
                "simulated sample": samples,
            }
            parts = {"start": 1.0, "prepared trial": trials, "prepared sample": samples}
            for name in names:
                parts |= {
                    f"{name} trial": trials,
                    f"{name} sample": samples * IDENTIFICATION_RATE / RATE,
                }
            contents[f"identify/{study}"] = parts
    run_workflow(folder, studies, "--cores", "1")
    seconds = [
        pd.read_csv(folder / "logs" / job / "0.tsv", sep="\t")["cpu_time"][0] for job in contents
    ]
    return pd.DataFrame(contents.values(), index=contents).fillna(0.0), np.array(seconds)


def fit(contents, seconds):
    """Times of the parts, none of them negative. Each job counts by its relative error."""
    scales = contents.max()
    solution, _ = nnls((contents / scales).to_numpy() / seconds[:, None], np.ones(len(seconds)))
    return solution / scales


def main():
    """Measure, fit and write."""
    with tempfile.TemporaryDirectory() as folder:
        contents, seconds = measure_jobs(Path(folder))
    parts = fit(contents, seconds)
    print(
        (contents @ parts / seconds).groupby(lambda job: job.split("/")[0]).describe().to_string()
    )
    samples = 50.0 * IDENTIFICATION_RATE
    wide, narrow = (
        parts[f"{name} trial"] + samples * parts[f"{name} sample"] for name in ("wide", "pr-moesp")
    )
    parts = parts.drop(["wide trial", "wide sample"])
    parts["block rows"] = math.log2(wide / narrow)
    rounded = {name: float(f"{value:.4g}") for name, value in parts.items()}
    MEASURED.write_text(json.dumps({"seconds": rounded}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
