# One job for each study and point: all of its trials, by every method, with their scores. What methods need alike of a
# trial is made once, and starting a job costs more than identifying ten trials does.
for _study in STUDIES.values():
    if _study.kind != "simulation":
        continue

    rule:
        name:
            f"identify_{_study.name.replace('-', '_')}"
        input:
            trials=f"results/trials/{_study.name}/{{point}}.nc",
        output:
            estimates=estimates(_study, "{point}"),
            scores=f"results/scores/{_study.name}/{{point}}.csv",
            parameters=f"results/parameters/{_study.name}/{{point}}.csv",
        log:
            f"logs/identify/{_study.name}/{{point}}.log",
        benchmark:
            f"logs/identify/{_study.name}/{{point}}.tsv"
        conda:
            "../envs/ankleloop.yaml"
        threads: 1
        resources:
            mem_mb=2000,
        params:
            study=_study.name,
            varied=lambda wildcards, study=_study: study.combinations[wildcards.point],
            methods={
                name: {"method": method["method"], "options": identify_options(method)}
                for name, method in _study.methods.items()
            },
            against=_study.against,
            precision=_study.settings["precision"],
            library=fingerprint("workflow/scripts/identify.py"),
        message:
            f"Identifying {_study.name} at {{wildcards.point}} by {len(_study.methods)} methods"
        script:
            "../scripts/identify.py"
