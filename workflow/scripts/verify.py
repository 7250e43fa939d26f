"""Check every number and claim of the paper."""

from pathlib import Path

import pandas as pd

from ankleloop.records.files import atomic_file
from ankleloop.replication.evidence import StudyResults
from ankleloop.replication.ledger import format_ledger, verify
from ankleloop.replication.results import read_results

from job import running


def read_chunks(paths, study):
    """One table of all chunks of a study."""
    return read_results(path for path in paths if Path(path).parent.name == study)


with running(snakemake):
    studies = {
        name: StudyResults(
            name=name,
            scores=read_chunks(snakemake.input.scores, name),
            parameters=read_chunks(snakemake.input.parameters, name),
            **description,
        )
        for name, description in snakemake.params.studies.items()
    }
    published = {Path(path).stem: pd.read_csv(path) for path in snakemake.input.published}
    ledger = verify(published.pop("claims"), published, studies, pd.read_csv(snakemake.input.economy))
    with atomic_file(snakemake.output.ledger) as path:
        ledger.to_csv(path, index=False)
    with atomic_file(snakemake.output.page) as path:
        path.write_text(format_ledger(ledger), encoding="utf-8")
