# The metadata of a run, as a Research Object Crate, and the page at which a reader starts: what was made, from which
# configuration and by which programs.
JOBS = {
    study.name: (
        {"recordings": study.chunks}
        if isinstance(study, RecordedStudy)
        else {
            "simulate": study.trial_files,
            "sweep" if study.settings.keep == "scores" else "identify": study.chunks,
        }
    )
    for study in RUN
}


rule index:
    input:
        results=targets(),
        conclusions=repository_file("data/conclusions.yaml"),
        rendered=[
            f"results/rendered/{study.name}"
            for study in RUN
            if study.settings.notebook
        ],
        tables=[
            path
            for study in RUN
            if isinstance(study, RecordedStudy)
            for path in chunk_files("scores", study)
        ],
        # What the pages show; without them here a storage would not hand them over.
        summaries=[
            *[
                f"results/tables/{study.name}.csv"
                for study in RUN
                if study.settings.notebook
            ],
            *(["results/tables/economy.csv"] if ARTICLE else []),
        ],
        ledger=["results/verification.csv"] if ARTICLE else [],
    output:
        metadata="results/ro-crate-metadata.json",
        source=directory("results/source"),
        configuration="results/configuration.json",
        provenance="results/provenance.json",
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
        configuration=CONFIG.model_dump(mode="json", by_alias=True),
        repository=lambda wildcards: str(ROOT),
        # Jobs of the run by their logs; folders may also hold those of earlier runs.
        jobs=[
            *(["verify", "article"] if ARTICLE else []),
            *[
                f"{rule}/{study}/{chunk}"
                for study, rules in JOBS.items()
                for rule, chunks in rules.items()
                for chunk in range(len(chunks))
            ],
            *[f"table/{name}" for name in JOBS if name in SIMULATED],
            *[f"predict/{study.name}" for study in RUN if prediction_files(study)],
            *[f"report/{study.name}" for study in RUN if study.settings.notebook],
        ],
        studies=[study.describe() for study in RUN],
        recordings=[
            path
            for study in RUN
            if isinstance(study, RecordedStudy)
            for point in study.points.values()
            for path in point["paths"]
        ],
        library=library("workflow/scripts/index.py"),
    script:
        "../scripts/index.py"
