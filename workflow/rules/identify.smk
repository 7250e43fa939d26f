# Identification of all trials of a chunk by every method of their study, and its scores. What methods need alike of a
# trial is computed once.
rule identify:
    input:
        trials="results/trials/{study}/{chunk}.nc",
    output:
        estimates="results/estimates/{study}/{chunk}.nc",
        scores="results/scores/{study}/{chunk}.csv",
        parameters="results/parameters/{study}/{chunk}.csv",
    log:
        "logs/identify/{study}/{chunk}.log",
    benchmark:
        "logs/identify/{study}/{chunk}.tsv"
    wildcard_constraints:
        study=SIMULATED,
    # Long jobs first, so that no core waits for one at the end.
    priority: identification_time
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    params:
        points=lambda wildcards: study_of(wildcards).varied_settings(
            chunk_of(wildcards)
        ),
        methods=lambda wildcards: study_of(wildcards).identified_methods,
        against=lambda wildcards: study_of(wildcards).settings.against,
        precision=lambda wildcards: study_of(wildcards).settings.precision,
        failures=lambda wildcards: study_of(wildcards).settings.failures,
        library=library("workflow/scripts/identify.py"),
    script:
        "../scripts/identify.py"
