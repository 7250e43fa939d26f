# The metadata of a run, as a Research Object Crate, and the page at which a reader starts: what was made, from which
# configuration and by which programs.
rule index:
    input:
        results=targets(),
        conclusions=repository_file("data/conclusions.yaml"),
        rendered=[
            f"results/rendered/{study.name}"
            for study in RUN
            if study.settings.notebook
        ],
        tables=recording_tables(),
        trial_tables=[
            table_file(study) for study in RUN if isinstance(study, SimulatedStudy)
        ],
        ledger=["results/verification.csv"] if ARTICLE else [],
    output:
        metadata="results/ro-crate-metadata.json",
        source=directory("results/source"),
        configuration="results/configuration.json",
        provenance="results/provenance.json",
        index="results/index.html",
        ledger=["results/ledger.html"] if ARTICLE else [],
    log:
        "logs/index.log",
    localrule: True
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    params:
        settings=digest(complete_config(CONFIG, STUDIES), [s.describe() for s in RUN]),
        configuration=lambda wildcards, output: complete_config(CONFIG, STUDIES),
        configurations=[os.path.abspath(path) for path in CONFIG_FILES],
        repository=lambda wildcards: str(ROOT),
        studies=lambda wildcards, output: [study.describe() for study in RUN],
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
