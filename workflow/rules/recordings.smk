# Recordings of a laboratory, from the file to a page each. A job takes several, because starting one costs as much as a
# recording does. An unusable recording is refused with its reason; the others go on.
rule recordings:
    input:
        files=lambda w: [
            local(path) for path in study_of(w).existing_paths(int(w.chunk))
        ],
    output:
        table="results/scores/{study}/{chunk}.parquet",
        folder=directory("results/recordings/{study}.{chunk}"),
    log:
        "logs/recordings/{study}/{chunk}.log",
    benchmark:
        "logs/recordings/{study}/{chunk}.tsv"
    wildcard_constraints:
        study=RECORDED,
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=memory,
        runtime=half_hour,
    params:
        settings=lambda w: digest(study_of(w).analysis(int(w.chunk))),
        arguments=lambda wildcards, output: study_of(wildcards).analysis(
            int(wildcards.chunk)
        ),
        library=library("workflow/scripts/recordings.py"),
    script:
        "../scripts/recordings.py"


# Pages and exported estimates of all recordings of a study, under the names that a reader opens.
rule publish:
    input:
        folders=lambda w: [
            f"results/recordings/{w.study}.{k}" for k in range(len(study_of(w).chunks))
        ],
    output:
        pages=directory("results/reports/{study}"),
        estimates=directory("results/estimates/{study}"),
    log:
        "logs/publish/{study}.log",
    wildcard_constraints:
        study=RECORDED,
    localrule: True
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    shell:
        "(mkdir -p {output}"
        " && find {input.folders} -mindepth 1 -maxdepth 1 -type f -name '*.html' -exec cp {{}} {output.pages} ';'"
        " && find {input.folders} -mindepth 1 -maxdepth 1 -type d -exec cp -r {{}} {output.estimates} ';') > {log} 2>&1"
