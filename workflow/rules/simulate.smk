# Simulated trials. A job takes as many points as its study says (`together`): starting one costs as much as some fifty
# trials do.
for _study in simulated(STUDIES):
    for _number, _points in enumerate(_study.jobs):

        rule:
            name:
                rule_name("simulate", _study, _number)
            output:
                trials=[trials(_study, point) for point in _points],
            log:
                f"logs/simulate/{_study.name}/{_number}.log",
            benchmark:
                f"logs/simulate/{_study.name}/{_number}.tsv"
            # Before any identification, and long jobs first, so that no core waits for one at the end.
            priority: 1000 + len(_points)
            conda:
                "../envs/ankleloop.yaml"
            threads: 1
            resources:
                mem_mb=2000,
            params:
                points={point: _study.points[point] for point in _points},
                seeds={point: trial_seeds(_study, point) for point in _points},
                precision=_study.settings["precision"],
                library=fingerprint("workflow/scripts/simulate.py"),
            message:
                f"Simulating {_study.name} at {'; '.join(_points)}"
            script:
                "../scripts/simulate.py"
