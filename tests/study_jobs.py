"""Jobs of a simulated study, run one after the other in this process as the rules of the workflow run them."""

import json
import logging
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import matplotlib.pyplot as plt

from ankleloop.trials.trial_files import save_trials
from ankleloop_workflow.config.notebooks import read_notebooks
from ankleloop_workflow.config.run import report_parameters
from ankleloop_workflow.config.study import read_studies
from ankleloop_workflow.jobs.identification import identify_trials, read_trials
from ankleloop_workflow.jobs.predictions import predict
from ankleloop_workflow.jobs.simulation import simulate_trials
from ankleloop_workflow.tables.trial_tables import join_tables

ROOT = Path(__file__).parents[1]
SCRIPTS = ROOT / "workflow" / "scripts"
NOTEBOOKS = read_notebooks()


def write_trials(path, study, seed, conditions, precision="double"):
    """Trial file of some conditions."""
    trials = simulate_trials(study, seed, conditions)
    index = [
        (name, number)
        for name, part in conditions.items()
        for number in range(part["first"], part["stop"])
    ]
    save_trials((trial for _, _, trial in trials), path, index, precision, overwrite=True)


def run_jobs(study, folder):
    """Run all jobs of a study; the paths of its table, its estimates and its trial files."""
    settings = study.settings
    folder.mkdir(parents=True, exist_ok=True)
    trial_files = [folder / f"trials-{number}.nc" for number in range(len(study.trial_files))]
    for path, parts in zip(trial_files, study.trial_files, strict=True):
        write_trials(path, study.name, precision=settings.precision, **study.simulation(parts))
    estimates, scores = [], []
    for chunk in range(len(study.chunks)):
        arguments = study.identification(chunk)
        simulation = arguments.pop("simulation")
        if not simulation:
            trials = read_trials(trial_files[study.file_numbers[chunk]], arguments["conditions"])
        else:
            trials = simulate_trials(study.name, precision=settings.precision, **simulation)
        files = {"scores": folder / f"scores-{chunk}.parquet"}
        if settings.keep != "scores":
            files["estimates"] = folder / f"estimates-{chunk}.parquet"
            estimates.append(str(files["estimates"]))
        identify_trials(trials, files, study.name, **arguments)
        scores.append(files["scores"])
    table = folder / f"{study.name}-trials.parquet"
    join_tables(table, table.with_suffix(".csv"), scores, rows=study.rows)
    return SimpleNamespace(table=table, scores=scores, estimates=estimates, trials=trial_files)


def run_notebook(study, results, folder):
    """Run the notebook of a study, which leaves its files in a folder; what it shows."""
    name = study.settings.notebook
    tables = [results.table]
    draws = NOTEBOOKS[name].predictions
    if draws:
        tables.append(folder / "predictions.parquet")
        predict(tables[-1], study.name, **study.prediction(draws))
    files = {"trials": results.trials, "estimates": results.estimates, "tables": tables}
    files = {kind: list(map(str, paths)) for kind, paths in files.items()}
    stem = str(folder / study.name)
    places = {
        "published": str(ROOT / "data" / "published"),
        "table_stem": stem,
        "figure_stem": stem,
    }
    return run_cells(name, report_parameters(study, NOTEBOOKS[name], files, **places))


def run_cells(notebook, parameters):
    """Run the code of a notebook with parameters in the place of its own; the markdown and HTML that it shows."""
    text = (ROOT / "notebooks" / f"{notebook}.ipynb").read_text(encoding="utf-8")
    shown, names = [], {}

    def show(*outputs):
        shown.extend(str(getattr(output, "data", output)) for output in outputs)

    with (
        plt.rc_context({"backend": "Agg"}),
        mock.patch("ankleloop_workflow.pages.study_page.display", show),
        mock.patch("IPython.display.display", show),
    ):
        for cell in json.loads(text)["cells"]:
            if cell["cell_type"] == "code":
                exec("".join(cell["source"]), names)
            if "parameters" in cell["metadata"].get("tags", ()):
                assert set(parameters) <= set(names)
                names |= parameters
    return "\n".join(shown)


def run_recordings_job(pages, **settings):
    """Run the script of the rule `recordings`, which leaves pages and `table.parquet` in the folder `pages`."""
    study = read_studies({"studies": {"laboratory": {"kind": "recordings", **settings}}})
    job = SimpleNamespace(
        params=SimpleNamespace(arguments=study[1]["laboratory"].analysis(0)),
        output=SimpleNamespace(folder=str(pages), table=str(pages / "table.parquet")),
        log=str(pages.with_suffix(".log")),
        rule="recordings",
        wildcards={"study": "laboratory", "chunk": "0"},
    )
    pages.mkdir()
    handlers, level = logging.root.handlers[:], logging.root.level
    try:
        with mock.patch.object(sys, "path", [str(SCRIPTS), *sys.path]):
            runpy.run_path(str(SCRIPTS / "recordings.py"), init_globals={"snakemake": job})
    finally:
        logging.root.handlers[:], logging.root.level = handlers, level
