# Scores and parameters of every trial and method of a point, one tidy table each.
rule evaluate:
    input:
        trials="results/trials/{study}/{point}.nc",
        estimates=lambda wildcards: estimates(STUDIES[wildcards.study], wildcards.point),
    output:
        scores="results/scores/{study}/{point}.csv",
        parameters="results/parameters/{study}/{point}.csv",
    log:
        "logs/evaluate/{study}/{point}.log",
    wildcard_constraints:
        study=either(SIMULATED),
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        varied=lambda wildcards: STUDIES[wildcards.study].combinations[wildcards.point],
        methods=lambda wildcards: list(STUDIES[wildcards.study].methods),
        against=lambda wildcards: STUDIES[wildcards.study].against,
        library=fingerprint("workflow/scripts/evaluate.py"),
    message:
        "Scoring {wildcards.study} at {wildcards.point}"
    script:
        "../scripts/evaluate.py"
