# Recordings of a laboratory, from the file to a page each. A job takes several, because starting one costs as much as a
# recording does. A bad recording is refused with its reason; the others go on.
for _study in STUDIES.values():
    for _number, _points in enumerate(batches(_study)):

        rule:
            name:
                f"recordings_{_study.name.replace('-', '_')}_{_number}"
            input:
                [existing(path) for point in _points for path in _study.sources(point)],
                style="workflow/report/page.html",
            output:
                pages=[page(_study, point) for point in _points],
                tables=[
                    f"results/parameters/{_study.name}/{point}.csv"
                    for point in _points
                ],
                estimates=[
                    directory(f"results/estimates/{_study.name}/{point}")
                    for point in _points
                ],
            log:
                f"logs/recordings/{_study.name}/{_number}.log",
            benchmark:
                f"logs/recordings/{_study.name}/{_number}.tsv"
            conda:
                "../envs/ankleloop.yaml"
            threads: 1
            resources:
                mem_mb=1000,
            params:
                points={
                    point: {
                        **_study.points[point],
                        "paths": _study.sources(point),
                        "parts": _study.parts(point),
                    }
                    for point in _points
                },
                methods={
                    name: without_selected(method)
                    for name, method in _study.methods.items()
                },
                figure=_study.settings["figure"],
                library=fingerprint("workflow/scripts/recordings.py"),
            message:
                f"{_study.name}, {len(_study.points)} recordings: {', '.join(_points)}"
            script:
                "../scripts/recordings.py"
