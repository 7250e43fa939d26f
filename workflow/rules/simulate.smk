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
        study=KEPT["everything"],
    # Before any identification, and long jobs first, so that no core waits for one at the end.
    priority: simulation_priority
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=chunk_memory("simulate"),
        runtime=chunk_runtime("simulate"),
    params:
        arguments=lambda wildcards: study_of(wildcards).simulation_arguments(
            chunk_of(wildcards)
        ),
        library=library("workflow/scripts/simulate.py"),
    script:
        "../scripts/simulate.py"
