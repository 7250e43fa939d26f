# What was made, from which configuration and by which programs: the metadata of a run, as a Research Object Crate.
rule crate:
    input:
        results=targets(),
    output:
        metadata="results/ro-crate-metadata.json",
        configuration="results/configuration.json",
        provenance="results/provenance.json",
    log:
        "logs/crate.log",
    localrule: True
    conda:
        "../envs/ankleloop.yaml"
    threads: 1
    params:
        configuration=CONFIG.model_dump(mode="json", by_alias=True),
        seeds={
            name: study.settings.seed
            for name, study in STUDIES.items()
            if isinstance(study, SimulatedStudy)
        },
        repository=str(ROOT),
        library=library("workflow/scripts/crate.py"),
    script:
        "../scripts/crate.py"
