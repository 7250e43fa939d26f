# Simulation and identification of a chunk in one job, where the study keeps no trials: none touches the disk.
rule sweep:
    output:
        scores="results/scores/{study}/{chunk}.csv",
        parameters="results/parameters/{study}/{chunk}.csv",
    log:
        "logs/sweep/{study}/{chunk}.log",
    benchmark:
        "logs/sweep/{study}/{chunk}.tsv"
    wildcard_constraints:
        study=KEPT["scores"],
    # Long jobs first, so that no core waits for one at the end.
    priority: identification_time
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=chunk_memory("sweep"),
        runtime=chunk_runtime("sweep"),
    params:
        arguments=lambda wildcards: study_of(wildcards).sweep_arguments(
            chunk_of(wildcards)
        ),
        library=library("workflow/scripts/sweep.py"),
    script:
        "../scripts/sweep.py"


use rule sweep as sweep_estimates with:
    output:
        estimates="results/estimates/{study}/{chunk}.parquet",
        scores="results/scores/{study}/{chunk}.csv",
        parameters="results/parameters/{study}/{chunk}.csv",
    wildcard_constraints:
        study=KEPT["estimates"],
