# What is made of several studies: the diagrams, the economy of the methods, the ledger and the article.
ARTICLE_STUDIES = article_studies(CONFIG)
PUBLISHED = sorted(str(path) for path in Path("data/published").glob("*.csv"))


rule diagrams:
    output:
        report(
            DIAGRAMS,
            category="Figures 1 and 2",
            caption="../report/diagrams.rst",
        ),
    log:
        "logs/diagrams.log",
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        library=fingerprint("workflow/scripts/diagrams.py"),
    message:
        "Drawing Figures 1 and 2"
    script:
        "../scripts/diagrams.py"


if ARTICLE_STUDIES:

    rule economy:
        input:
            trials=f"results/trials/{ARTICLE_STUDIES[0].name}/{next(iter(ARTICLE_STUDIES[0].points))}.nc",
        output:
            table=ARTICLE["economy"],
        log:
            "logs/economy.log",
        conda:
            "../envs/ankleloop.yaml"
        threads: 1
        resources:
            mem_mb=1000,
        params:
            library=fingerprint("workflow/scripts/economy.py"),
        message:
            "Timing PR-MOESP and EIV-MOESP side by side"
        script:
            "../scripts/economy.py"

    rule verify:
        input:
            published=PUBLISHED,
            economy=ARTICLE["economy"],
            scores=[path for study in ARTICLE_STUDIES for path in scores(study)],
            parameters=[
                path
                for study in ARTICLE_STUDIES
                for path in scores(study, "parameters")
            ],
        output:
            ledger=report(
                ARTICLE["verification"],
                category="Verification",
                caption="../report/verification.rst",
            ),
            page=ARTICLE["page"],
        log:
            "logs/verify.log",
        conda:
            "../envs/ankleloop.yaml"
        threads: 1
        resources:
            mem_mb=1000,
        params:
            studies={
                study.name: {
                    "kind": study.kind,
                    "points": study.points,
                    "labels": study.labels,
                }
                for study in ARTICLE_STUDIES
            },
            library=fingerprint("workflow/scripts/verify.py"),
        message:
            "Judging every number and claim of the paper"
        script:
            "../scripts/verify.py"

    rule article:
        input:
            [path for study in ARTICLE_STUDIES for path in reports(study)],
            [path for study in ARTICLE_STUDIES for path in scores(study)],
            DIAGRAMS,
            ARTICLE["economy"],
            ARTICLE["verification"],
            notebook="notebooks/article.ipynb",
            style="workflow/report/page.html",
        output:
            report(
                ARTICLE["report"],
                category="Article",
                caption="../report/article.rst",
            ),
        log:
            "logs/article.log",
        conda:
            "../envs/ankleloop.yaml"
        threads: 1
        resources:
            mem_mb=1000,
        params:
            parameters=article_parameters(CONFIG),
            library=fingerprint("notebooks/article.ipynb"),
        message:
            "Rendering the article"
        script:
            "../scripts/render.py"
