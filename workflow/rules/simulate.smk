# Trials: simulated, or read from the files of a laboratory.
SIMULATED = [name for name, study in STUDIES.items() if study.kind == "simulation"]
RECORDED = [name for name, study in STUDIES.items() if study.kind == "recordings"]


rule simulate:
    output:
        trials="results/trials/{study}/{point}.nc",
    log:
        "logs/simulate/{study}/{point}.log",
    benchmark:
        "logs/simulate/{study}/{point}.tsv"
    wildcard_constraints:
        study="|".join(SIMULATED) or "$^",
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        parameters=lambda wildcards: STUDIES[wildcards.study].points[wildcards.point],
        seeds=lambda wildcards: trial_seeds(STUDIES[wildcards.study], wildcards.point),
        precision=lambda wildcards: STUDIES[wildcards.study].settings["precision"],
        library=fingerprint("workflow/scripts/simulate.py"),
    message:
        "Simulating {wildcards.study} at {wildcards.point}"
    script:
        "../scripts/simulate.py"


rule read:
    input:
        recording=lambda wildcards: STUDIES[wildcards.study].source(wildcards.point),
    output:
        trials="results/trials/{study}/{point}.nc",
    log:
        "logs/read/{study}/{point}.log",
    wildcard_constraints:
        study="|".join(RECORDED) or "$^",
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        mapping=lambda wildcards: STUDIES[wildcards.study].points[wildcards.point],
        library=fingerprint("workflow/scripts/read.py"),
    message:
        "Reading {wildcards.point} of {wildcards.study}"
    script:
        "../scripts/read.py"
