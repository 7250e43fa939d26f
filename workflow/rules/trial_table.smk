# All trials of a study in one table: a row for each point, method and trial, with scores and parameters. Small ones are
# written as CSV, too.
rule trial_table:
    input:
        scores=collect("results/scores/{{study}}/{chunk}.csv", chunk=chunks),
        parameters=collect("results/parameters/{{study}}/{chunk}.csv", chunk=chunks),
    output:
        table="results/tables/{study}-trials.parquet",
    log:
        "logs/trial_table/{study}.log",
    benchmark:
        "logs/trial_table/{study}.tsv"
    wildcard_constraints:
        study=alternatives(
            name
            for name, study in STUDIES.items()
            if isinstance(study, SimulatedStudy) and name not in SMALL
        ),
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=table_memory,
        runtime=table_runtime,
    params:
        varied=lambda wildcards: study_of(wildcards).varied,
        points=lambda wildcards: len(study_of(wildcards).point_list),
        methods=lambda wildcards: list(study_of(wildcards).methods),
        trials=lambda wildcards: study_of(wildcards).settings.trials,
        library=library("workflow/scripts/trial_table.py"),
    script:
        "../scripts/trial_table.py"


use rule trial_table as small_trial_table with:
    output:
        table="results/tables/{study}-trials.parquet",
        text="results/tables/{study}-trials.csv",
    wildcard_constraints:
        study=alternatives(SMALL),
