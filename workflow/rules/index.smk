# The page at which a reader starts: it lists whatever is there of the results.
rule index:
    input:
        metadata=rules.crate.output.metadata,
        configuration=rules.crate.output.configuration,
        provenance=rules.crate.output.provenance,
        results=targets(),
        rendered=[
            f"results/rendered/{study.name}"
            for study in run_studies(CONFIG, STUDIES)
            if study.settings.notebook
        ],
        parameters=[
            path
            for study in run_studies(CONFIG, STUDIES)
            if isinstance(study, RecordedStudy)
            for path in chunk_files("parameters", study)
        ],
    output:
        index="results/index.html",
        tables="results/tables.html",
        ledger=["results/ledger.html"] if ARTICLE else [],
    log:
        "logs/index.log",
    localrule: True
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    params:
        folder=lambda wildcards, input: os.path.dirname(input.provenance),
        studies={
            study.name: {
                "title": study.title,
                "kind": study.kind,
                "points": len(study.points),
                "methods": len(study.methods),
                "trials": getattr(study.settings, "trials", None),
                "seed": getattr(study.settings, "seed", None),
            }
            for study in run_studies(CONFIG, STUDIES)
        },
        library=library("workflow/scripts/index.py"),
    script:
        "../scripts/index.py"
