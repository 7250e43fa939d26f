"""Judge every number and claim of the paper."""

from pathlib import Path

import pandas as pd

from ankleloop.records.files import whole_file
from ankleloop.replication.ledger import StudyResults, as_markdown, verify

from job import running

with running(snakemake):
    files = {"scores": snakemake.input.scores, "parameters": snakemake.input.parameters}

    def gathered(table, study):
        paths = [path for path in files[table] if Path(path).parent.name == study]
        return pd.concat([pd.read_csv(path) for path in paths])

    studies = {
        name: StudyResults(scores=gathered("scores", name), parameters=gathered("parameters", name), **given)
        for name, given in snakemake.params.studies.items()
    }
    published = {Path(path).stem: pd.read_csv(path) for path in snakemake.input.published}
    claims = published.pop("claims")
    ledger = verify(claims, published, studies, pd.read_csv(snakemake.input.economy))
    with whole_file(snakemake.output.ledger) as path:
        ledger.to_csv(path, index=False)
    with whole_file(snakemake.output.page) as path:
        path.write_text(as_markdown(ledger), encoding="utf-8")
