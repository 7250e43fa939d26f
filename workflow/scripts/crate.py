"""The configuration with all defaults, and the metadata of the run as a Research Object Crate."""

import json
from pathlib import Path

from ankleloop.studies.provenance import read_provenance, save_provenance
from ankleloop.studies.run_crate import write_crate
from ankleloop.trials.files import atomic_file

from job import running

with running(snakemake):
    configuration = Path(snakemake.output.configuration)
    with atomic_file(configuration, overwrite=True) as path:
        path.write_text(json.dumps(snakemake.params.configuration, indent=2, ensure_ascii=False) + "\n", "utf-8")
    provenance = read_provenance(snakemake.params.repository)
    save_provenance(provenance, snakemake.output.provenance, overwrite=True)
    write_crate(configuration.parent, snakemake.input.results, configuration, provenance, snakemake.params.seeds)
