# From the configuration to the table of all trials of a study.


# Simulated trials. A trial file holds those of some conditions of a study, or part of the trials of one: starting a job
# costs as much as some fifty trials do.
rule simulate:
    output:
        trials="results/trials/{study}/{chunk}.nc",
    log:
        "logs/simulate/{study}/{chunk}.log",
    benchmark:
        "logs/simulate/{study}/{chunk}.tsv"
    wildcard_constraints:
        study=names_keeping("everything"),
    # Before any identification.
    priority: 1
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=memory,
        runtime=half_hour,
    params:
        settings=lambda w: digest(trials_in_file(w)),
        arguments=lambda wildcards, output: trials_in_file(wildcards),
        precision=lambda w: study_of(w).settings.precision,
        library=library("workflow/scripts/simulate.py"),
    script:
        "../scripts/simulate.py"


# Identification of all trials of a chunk by every method of their study, and its scores. What methods need alike of a
# trial is computed once. Where no trials are kept, the job simulates them as well, and none touches the disk.
rule identify:
    input:
        trials=trial_file_of,
    output:
        estimates="results/estimates/{study}/{chunk}.parquet",
        scores="results/scores/{study}/{chunk}.parquet",
    log:
        "logs/identify/{study}/{chunk}.log",
    benchmark:
        "logs/identify/{study}/{chunk}.tsv"
    wildcard_constraints:
        study=names_keeping("everything", "estimates"),
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=memory,
        runtime=half_hour,
    params:
        settings=lambda w: digest(identification_of(w)),
        arguments=lambda wildcards, output: identification_of(wildcards),
        library=library("workflow/scripts/identify.py"),
    script:
        "../scripts/identify.py"


use rule identify as sweep with:
    output:
        scores="results/scores/{study}/{chunk}.parquet",
    log:
        "logs/sweep/{study}/{chunk}.log",
    benchmark:
        "logs/sweep/{study}/{chunk}.tsv"
    wildcard_constraints:
        study=names_keeping("scores"),


# What the trials are compared with: Cramér-Rao bounds, and lengths of records that pilots ask for.
rule predict:
    output:
        table="results/tables/{study}-predictions.parquet",
    log:
        "logs/predict/{study}.log",
    benchmark:
        "logs/predict/{study}.tsv"
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=memory,
        runtime=half_hour,
    params:
        settings=lambda w: digest(prediction_of(w)),
        arguments=lambda wildcards, output: prediction_of(wildcards),
        library=library("workflow/scripts/predict.py"),
    script:
        "../scripts/predict.py"


# All trials of a study in one table: a row for each point, method and trial, with scores and parameters; as CSV, too.
rule table:
    input:
        chunks=lambda w: chunk_files("scores", study_of(w)),
    output:
        table="results/tables/{study}-trials.parquet",
        text="results/tables/{study}-trials.csv",
    log:
        "logs/table/{study}.log",
    benchmark:
        "logs/table/{study}.tsv"
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=memory,
        runtime=half_hour,
    params:
        settings=lambda w: digest(study_of(w).chunks),
        rows=lambda w: study_of(w).rows,
        library=library("workflow/scripts/table.py"),
    script:
        "../scripts/table.py"
