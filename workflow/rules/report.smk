# One notebook for each study: its tables, its figures and a page that needs nothing else.
for _study in STUDIES.values():
    if _study.notebook is None:
        continue

    rule:
        name:
            f"notebook_{_study.name.replace('-', '_')}"
        input:
            notebook_inputs(_study),
            notebook=f"notebooks/{_study.notebook}.ipynb",
            published=Path("data/published").glob("*.csv"),
            style="workflow/report/page.html",
        output:
            report(
                reports(_study),
                category=_study.settings["title"],
                caption=f"../report/{_study.notebook}.rst",
            ),
        log:
            f"logs/notebook/{_study.name}.log",
        conda:
            "../envs/ankleloop.yaml"
        threads: 1
        resources:
            mem_mb=2000,
        params:
            parameters=notebook_parameters(_study),
            library=fingerprint(f"notebooks/{_study.notebook}.ipynb"),
        message:
            f"Rendering the notebook of {_study.name}"
        script:
            "../scripts/render.py"
