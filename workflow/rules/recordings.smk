# Recordings of a laboratory: one job each, from the file to its page. A bad one is refused with its reason; the others
# go on.
rule recording:
    input:
        recording=lambda wildcards: existing(
            STUDIES[wildcards.study].source(wildcards.point)
        ),
        style="workflow/report/page.html",
    output:
        page="results/reports/{study}/{point}.html",
        table="results/parameters/{study}/{point}.csv",
        estimates=directory("results/estimates/{study}/{point}"),
    log:
        "logs/recording/{study}/{point}.log",
    benchmark:
        "logs/recording/{study}/{point}.tsv"
    wildcard_constraints:
        study=either(RECORDED),
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        path=lambda wildcards: STUDIES[wildcards.study].source(wildcards.point),
        mapping=lambda wildcards: STUDIES[wildcards.study].points[wildcards.point],
        methods=lambda wildcards: {
            name: without_selected(method)
            for name, method in STUDIES[wildcards.study].methods.items()
        },
        figure=lambda wildcards: STUDIES[wildcards.study].settings["figure"],
        library=fingerprint("workflow/scripts/recording.py"),
    message:
        "Recording {wildcards.point} of {wildcards.study}"
    script:
        "../scripts/recording.py"
