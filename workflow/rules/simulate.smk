# Simulated trials.
SIMULATED = [name for name, study in STUDIES.items() if study.kind == "simulation"]


rule simulate:
    output:
        trials="results/trials/{study}/{point}.nc",
    log:
        "logs/simulate/{study}/{point}.log",
    benchmark:
        "logs/simulate/{study}/{point}.tsv"
    wildcard_constraints:
        study=either(SIMULATED),
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
