# What is made of several studies: the diagrams, the economy of the methods, the ledger and the article.
# The economy is that of the published methods, on the trials of Table 1.
ECONOMY = {study.name: study for study in ARTICLE if study.name == "table1"}


rule diagrams:
    output:
        report(
            expand(
                "results/figures/{figure}.{suffix}",
                figure=DIAGRAMS,
                suffix=["png", "pdf", "svg"],
            ),
            category="Figures 1 and 2",
            caption="../report/diagrams.rst",
        ),
    log:
        "logs/diagrams.log",
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    params:
        library=library("workflow/scripts/diagrams.py"),
    script:
        "../scripts/diagrams.py"


rule economy:
    input:
        trials=[path for study in ECONOMY.values() for path in trial_files(study)],
    output:
        table="results/tables/economy.csv",
    log:
        "logs/economy.log",
    benchmark:
        "logs/economy.tsv"
    conda:
        "../envs/ankleloop.yaml"
    # All cores of a local run: a job at its side would change the times.
    threads: local_cores()
    resources:
        mem_mb=table_memory,
        runtime=table_runtime,
    params:
        options={
            name: study.identified_methods[name]["options"]
            for study in ECONOMY.values()
            for name in ("pr-moesp", "eiv-moesp")
            if name in study.methods
        },
        library=library("workflow/scripts/economy.py"),
    script:
        "../scripts/economy.py"


rule verify:
    input:
        published=OF_PAPER,
        findings=repository_file("data/findings.csv"),
        economy="results/tables/economy.csv",
        scores=chunk_files_of_article("scores"),
        parameters=chunk_files_of_article("parameters"),
    output:
        ledger=report(
            "results/verification.csv",
            category="Verification",
            caption="../report/verification.rst",
        ),
        page="results/verification.md",
    log:
        "logs/verify.log",
    benchmark:
        "logs/verify.tsv"
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=table_memory,
        runtime=table_runtime,
    params:
        studies={
            study.name: {
                "kind": study.kind,
                "points": study.points,
                "labels": study.labels,
            }
            for study in ARTICLE
        },
        library=library("workflow/scripts/verify.py"),
    script:
        "../scripts/verify.py"


rule article:
    input:
        scores=chunk_files_of_article("scores"),
        parameters=chunk_files_of_article("parameters"),
        reports=[f"results/reports/{study.name}.html" for study in ARTICLE],
        tables=[f"results/tables/{study.name}.csv" for study in ARTICLE],
        figures=[path for study in ARTICLE for path in figure_files(study)],
        diagrams=[f"results/figures/{name}.png" for name in DIAGRAMS],
        economy="results/tables/economy.csv",
        verification="results/verification.csv",
        conclusions=repository_file("data/conclusions.yaml"),
        notebook=repository_file("notebooks/article.ipynb"),
    output:
        page=report(
            "results/article.html",
            category="Article",
            caption="../report/article.rst",
        ),
    log:
        "logs/article.log",
    benchmark:
        "logs/article.tsv"
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=table_memory,
        runtime=table_runtime,
    params:
        parameters=lambda wildcards, input: article_parameters(
            ARTICLE,
            {
                study.name: article_files(
                    study, input.economy.removesuffix("results/tables/economy.csv")
                )
                for study in ARTICLE
            },
            verification=input.verification,
            conclusions=input.conclusions,
            economy=input.economy,
            diagrams=list(input.diagrams),
        ),
        library=library("workflow/scripts/render.py", "notebooks/article.ipynb"),
    script:
        "../scripts/render.py"
