# Identification of all trials of a chunk by every method of their study, and its scores. What methods need alike of a
# trial is computed once. Where no trials are kept, `sweep` does this and the simulation in one job.
rule identify:
    input:
        trials=trial_file_of,
    output:
        estimates="results/estimates/{study}/{chunk}.parquet",
        scores="results/scores/{study}/{chunk}.csv",
        parameters="results/parameters/{study}/{chunk}.csv",
    log:
        "logs/identify/{study}/{chunk}.log",
    benchmark:
        "logs/identify/{study}/{chunk}.tsv"
    wildcard_constraints:
        study=KEPT["everything"],
    # Long jobs first, so that no core waits for one at the end.
    priority: identification_time
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=chunk_memory("identify"),
        runtime=chunk_runtime("identify"),
    params:
        arguments=lambda wildcards: study_of(wildcards).identification_arguments(
            chunk_of(wildcards)
        ),
        library=library("workflow/scripts/identify.py"),
    script:
        "../scripts/identify.py"
