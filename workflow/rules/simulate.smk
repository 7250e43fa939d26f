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
        seed=lambda wildcards: study_of(wildcards).settings.seed,
        points=lambda wildcards: study_of(wildcards).simulated_points(
            chunk_of(wildcards), stored=True
        ),
        precision=lambda wildcards: study_of(wildcards).settings.precision,
        failures=lambda wildcards: study_of(wildcards).settings.failures,
        library=library("workflow/scripts/simulate.py"),
    script:
        "../scripts/simulate.py"
