"""The job of a chunk of recordings: what fails numerically is refused with its reason, the others finish."""

import logging
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from ankleloop import save_trial, simulate
from ankleloop.pages import recordings as pages
from ankleloop.recordings import files
from ankleloop.replication.results import read_results
from ankleloop.studies.study import read_studies

SCRIPTS = Path(__file__).parents[3] / "workflow" / "scripts"
NAMES = ("good", "bad")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for seed, name in enumerate(NAMES):
        save_trial(simulate(seed=seed, duration=20.0), folder / f"{name}.nc")
    return folder


@pytest.fixture
def run_job(folder, tmp_path, monkeypatch):
    """Run the script of the rule `recordings` on two recordings; it gives the table and the folder of the pages."""

    def run():
        settings = {
            "kind": "recordings",
            "folder": str(folder),
            "files": {name: {"file": f"{name}.nc", "subject": "007", "reference": "reference"} for name in NAMES},
            "methods": {"riv": {"method": "riv"}},
        }
        study = read_studies({"studies": {"laboratory": settings}})[1]["laboratory"]
        job = SimpleNamespace(
            params=SimpleNamespace(
                points=study.mappings(0),
                methods=study.analysed_methods,
                figure=study.settings.figure.model_dump(),
            ),
            output=SimpleNamespace(folder=str(tmp_path / "pages"), table=str(tmp_path / "table.csv")),
            log=str(tmp_path / "job.log"),
            wildcards={"study": "laboratory", "chunk": "0"},
        )
        monkeypatch.syspath_prepend(str(SCRIPTS))
        handlers, level = logging.root.handlers[:], logging.root.level
        try:
            runpy.run_path(str(SCRIPTS / "recordings.py"), init_globals={"snakemake": job})
        finally:
            logging.root.handlers[:], logging.root.level = handlers, level
        return read_results([job.output.table]), Path(job.output.folder)

    return run


def fail_on_bad(function, error):
    """The function, which fails at its second call, that for the second recording, and never again."""
    calls = []

    def change(*args, **options):
        calls.append(None)
        if len(calls) == 2:
            raise error
        return function(*args, **options)

    return change


@pytest.mark.parametrize("error", [np.linalg.LinAlgError("SVD did not converge"), FloatingPointError("overflow")])
@pytest.mark.parametrize(("module", "name"), [(files, "analyse"), (pages, "embed_recording_figures")])
def test_a_numerical_error_refuses_one_recording(run_job, monkeypatch, capsys, module, name, error):
    monkeypatch.setattr(module, name, fail_on_bad(getattr(module, name), error))
    table, folder = run_job()
    by_name = table.groupby("recording")["verdict"].first()
    assert by_name["bad"] == "refused" != by_name["good"]
    reason = f"the analysis failed numerically ({type(error).__name__}: {error})."
    assert table.set_index("recording").loc["bad", "reasons"] == reason
    assert f"bad refused: {reason}" in capsys.readouterr().err
    assert {path.name for path in folder.iterdir()} == {"good", "good.html", "bad.html"}
    assert str(error) in (folder / "bad.html").read_text(encoding="utf-8")
    assert pd.notna(table.set_index("recording").loc["good", "K"])
    assert (table["subject"] == "007").all()


def test_mistakes_in_the_program_stop_the_job(run_job, monkeypatch):
    monkeypatch.setattr(files, "analyse", fail_on_bad(files.analyse, TypeError("no such option")))
    with pytest.raises(SystemExit, match="TypeError in study laboratory, chunk 0: no such option"):
        run_job()
