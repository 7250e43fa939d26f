# One job for each study, point and method; it loops over the trials.
rule identify:
    input:
        trials="results/trials/{study}/{point}.nc",
    output:
        estimates="results/estimates/{study}/{point}/{method}.nc",
    log:
        "logs/identify/{study}/{point}/{method}.log",
    benchmark:
        "logs/identify/{study}/{point}/{method}.tsv"
    wildcard_constraints:
        study=either(SIMULATED),
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        method=lambda wildcards: STUDIES[wildcards.study].methods[wildcards.method][
            "method"
        ],
        options=lambda wildcards: identify_options(
            STUDIES[wildcards.study].methods[wildcards.method]
        ),
        library=fingerprint("workflow/scripts/identify.py"),
    message:
        "Identifying {wildcards.study} at {wildcards.point} by {wildcards.method}"
    script:
        "../scripts/identify.py"
