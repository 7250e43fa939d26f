"""Check every number and claim of the paper."""

from pathlib import Path

import pandas as pd

from ankleloop.paper.completeness import check_study
from ankleloop.paper.evidence import StudyResults
from ankleloop.paper.ledger import format_ledger, verify
from ankleloop.paper.results import read_results
from ankleloop.trials.files import atomic_file

from job import running


def chunk_files(kind, study):
    """Files of all chunks of a study."""
    return [path for path in snakemake.input[kind] if Path(path).parent.name == study]


with running(snakemake):
    for name, description in snakemake.params.studies.items():
        tables = [chunk_files(kind, name) for kind in ("parameters", "scores")]
        check_study(*tables, description["points"], description["labels"])
    studies = {
        name: StudyResults(
            name=name,
            scores=read_results(chunk_files("scores", name)),
            parameters=read_results(chunk_files("parameters", name)),
            **description,
        )
        for name, description in snakemake.params.studies.items()
    }
    published = {Path(path).stem: pd.read_csv(path) for path in snakemake.input.published}
    claims, findings = published.pop("claims"), pd.read_csv(snakemake.input.findings)
    ledger = verify(claims, published, studies, pd.read_csv(snakemake.input.economy), findings)
    with atomic_file(snakemake.output.ledger, overwrite=True) as path:
        ledger.to_csv(path, index=False)
    with atomic_file(snakemake.output.page, overwrite=True) as path:
        path.write_text(format_ledger(ledger), encoding="utf-8")
