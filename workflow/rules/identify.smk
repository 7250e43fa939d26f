# Identification of all trials of some points by every method of their study, and its scores. What methods need alike of
# a trial is made once.
for _study in simulated(STUDIES):
    for _number, _points in enumerate(_study.jobs):

        rule:
            name:
                rule_name("identify", _study, _number)
            input:
                trials=[trials(_study, point) for point in _points],
            output:
                estimates=[
                    path for point in _points for path in estimates(_study, point)
                ],
                scores=[
                    f"results/scores/{_study.name}/{point}.csv" for point in _points
                ],
                parameters=[
                    f"results/parameters/{_study.name}/{point}.csv"
                    for point in _points
                ],
            log:
                f"logs/identify/{_study.name}/{_number}.log",
            benchmark:
                f"logs/identify/{_study.name}/{_number}.tsv"
            # Long jobs first, so that no core waits for one at the end.
            priority: len(_points)
            conda:
                "../envs/ankleloop.yaml"
            threads: 1
            resources:
                mem_mb=2000,
            params:
                study=_study.name,
                points={point: _study.combinations[point] for point in _points},
                methods={
                    name: {
                        "method": method["method"],
                        "options": identify_options(method),
                    }
                    for name, method in _study.methods.items()
                },
                against=_study.against,
                precision=_study.settings["precision"],
                library=fingerprint("workflow/scripts/identify.py"),
            message:
                f"Identifying {_study.name} at {'; '.join(_points)} by {len(_study.methods)} methods"
            script:
                "../scripts/identify.py"
