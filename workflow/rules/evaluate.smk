# Scores and parameters of every trial, one tidy table each.
rule evaluate:
    input:
        trials="results/trials/{study}/{point}.nc",
        estimates="results/estimates/{study}/{point}/{method}.nc",
    output:
        scores="results/scores/{study}/{point}/{method}.csv",
        parameters="results/scores/{study}/{point}/{method}.parameters.csv",
    log:
        "logs/evaluate/{study}/{point}/{method}.log",
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        varied=lambda wildcards: STUDIES[wildcards.study].combinations[wildcards.point],
        library=fingerprint("workflow/scripts/evaluate.py"),
    message:
        "Scoring {wildcards.method} on {wildcards.study} at {wildcards.point}"
    script:
        "../scripts/evaluate.py"
