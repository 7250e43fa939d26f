# What is made of several studies: the ledger with the economy of the methods, and the article with the diagrams.


CLAIMS = ("data/published/claims.yaml", "data/findings.yaml")


# The economy is that of the published methods, on the trials of Table 1.
rule verify:
    input:
        published=[published_file("table1.csv"), published_file("table2.csv")],
        claims=[repository_file(path) for path in CLAIMS],
        trials=[
            path
            for study in ARTICLE
            if study.name == "table1"
            for path in trial_files(study)
        ],
        tables=[table_file(study) for study in ARTICLE],
    output:
        economy="results/tables/economy.csv",
        ledger=report(
            "results/verification.csv",
            category="Verification",
            caption="../report/verification.rst",
            labels={"result": "ledger"},
        ),
    log:
        "logs/verify.log",
    benchmark:
        "logs/verify.tsv"
    conda:
        "../envs/ankleloop.yaml"
    # All cores of a local run: a job at its side would change the times.
    threads: local_cores()
    resources:
        mem_mb=memory,
        runtime=half_hour,
    params:
        settings=digest([[study.name, study.points, study.labels] for study in ARTICLE]),
        options={
            name: study.methods[name].fixed_options
            for study in ARTICLE
            if study.name == "table1"
            for name in ("pr-moesp", "eiv-moesp")
            if name in study.methods
        },
        studies=lambda wildcards, output: [study.describe() for study in ARTICLE],
        library=library("workflow/scripts/verify.py"),
    script:
        "../scripts/verify.py"


rule article_notebook:
    input:
        tables=[table_file(study) for study in ARTICLE],
        summaries=[f"results/tables/{study.name}.csv" for study in ARTICLE],
        figures=[path for study in ARTICLE for path in figure_files(study)],
        economy=rules.verify.output.economy,
        verification=rules.verify.output.ledger,
        conclusions=repository_file("data/conclusions.yaml"),
        notebook=repository_file("notebooks/article.ipynb"),
        diagrams=[repository_file(f"data/diagrams/{name}") for name in DIAGRAMS],
    output:
        code="results/notebooks/article.ipynb",
        diagrams=[
            report(
                f"results/figures/{name}",
                category="Figures 1 and 2",
                caption="../report/diagrams.rst",
                labels={"result": name},
            )
            for name in DIAGRAMS
        ],
    log:
        "logs/notebook/article.log",
    benchmark:
        "logs/notebook/article.tsv"
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=memory,
        runtime=half_hour,
    params:
        settings=digest([study.describe() for study in ARTICLE]),
        parameters=lambda wildcards, input, output: describe_sources(input, output),
        library=library("workflow/scripts/execute.py", "notebooks/article.ipynb"),
    script:
        "../scripts/execute.py"


rule article:
    input:
        code=rules.article_notebook.output.code,
        reports=[f"results/reports/{study.name}.html" for study in ARTICLE],
    output:
        page=report(
            "results/article.html",
            category="Article",
            caption="../report/article.rst",
            labels={"result": "article"},
        ),
    log:
        "logs/article.log",
    localrule: True
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    params:
        library=library("workflow/scripts/page.py"),
    script:
        "../scripts/page.py"
