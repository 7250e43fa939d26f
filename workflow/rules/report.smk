# One notebook for each study, which writes its tables and figures; the page of it needs nothing else.
rule notebook:
    input:
        trials=trials_of,
        estimates=estimates_of,
        tables=tables_of,
        notebook=lambda wildcards: repository_file(notebook_file(wildcards)),
        published=published_of,
        ledger=ledger_of,
    output:
        table=of_report("results/tables/{study}.csv", "table"),
        markdown="results/tables/{study}.md",
        figures=directory("results/rendered/{study}"),
        code="results/notebooks/{study}.ipynb",
    log:
        "logs/notebook/{study}.log",
    benchmark:
        "logs/notebook/{study}.tsv"
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=memory,
        runtime=half_hour,
    params:
        settings=lambda w: digest(study_of(w).describe()),
        caption=lambda w: notebook_of(w).shows,
        parameters=lambda wildcards, input, output: report_parameters(
            study_of(wildcards),
            notebook_of(wildcards),
            input,
            published=str(ROOT / "data" / "published"),
            table_stem=os.path.splitext(output.table)[0],
            figure_stem=f"{output.figures}/{wildcards.study}",
        ),
        library=lambda w: library("workflow/scripts/execute.py", notebook_file(w)),
    script:
        "../scripts/execute.py"


rule report:
    input:
        code=rules.notebook.output.code,
        tables=tables_of,
    output:
        page=of_report("results/reports/{study}.html", "page"),
    log:
        "logs/report/{study}.log",
    localrule: True
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    params:
        caption=lambda w: notebook_of(w).shows,
        library=library("workflow/scripts/page.py"),
    script:
        "../scripts/page.py"


# A figure of a notebook with the numbers that it draws, under the names that a reader opens.
rule figure:
    input:
        folder="results/rendered/{study}",
    output:
        png=of_report("results/figures/{study}-{figure}.png", "{figure}"),
        pdf="results/figures/{study}-{figure}.pdf",
        csv="results/figures/{study}-{figure}.csv",
    log:
        "logs/figure/{study}-{figure}.log",
    localrule: True
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    params:
        caption=lambda w: captions_of(study_of(w))[w.figure],
        stem=lambda wildcards, input: f"{input.folder}/{wildcards.study}-{wildcards.figure}",
    shell:
        "(cp {params.stem}.png {output.png} && cp {params.stem}.pdf {output.pdf} && cp {params.stem}.csv {output.csv}) > {log} 2>&1"
