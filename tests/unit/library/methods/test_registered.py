"""Methods that a package registers by an entry point: found by name, in studies as well, and its faults by its name."""

import json
import os
import subprocess
import sys
import textwrap

import pytest

MODULE = """
import numpy as np

from ankleloop import METHODS
from ankleloop.methods.method import MethodOptions, Method, Offer, Validity
from ankleloop.options import option


class TwiceOptions(MethodOptions):
    factor: float = option(2.0, "factor of K", ge=0, le=10)


def identify_twice(trial, options):
    from dataclasses import replace

    riv = METHODS["riv"]
    estimate = riv.identify([trial], riv.options())
    return replace(estimate, stiffness={**estimate.stiffness, "K": options.factor * estimate.stiffness["K"]})


TWICE = Method("twice", TwiceOptions, identify_twice, validity=Validity(closed={}), offer=Offer("Twice"))
METHODS_OF_MINE = (TWICE, Method("riv", TwiceOptions, identify_twice))
"""
ENTRY_POINTS = """
[ankleloop.methods]
mine = mine:METHODS_OF_MINE
broken = mine:MISSING
wrong = mine:np
"""
STUDY = {
    "kind": "simulation",
    "notebook": None,
    "trials": 1,
    "seed": 1,
    "points": {"a.factor": [2.0, 3.0]},
}


@pytest.fixture
def run(tmp_path):
    """Run code in a process that has the package `mine` installed."""
    (tmp_path / "mine.py").write_text(MODULE, encoding="utf-8")

    def run(code, version="1.0"):
        information = tmp_path / "mine.dist-info"
        information.mkdir(exist_ok=True)
        metadata = f"Metadata-Version: 2.1\nName: mine\nVersion: {version}\n"
        (information / "METADATA").write_text(metadata, encoding="utf-8")
        (information / "entry_points.txt").write_text(ENTRY_POINTS, encoding="utf-8")
        environment = dict(os.environ)
        paths = [str(tmp_path), *filter(None, [environment.get("PYTHONPATH")])]
        environment["PYTHONPATH"] = os.pathsep.join(paths)
        process = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(code)],
            capture_output=True,
            text=True,
            env=environment,
        )
        assert process.returncode == 0, process.stderr
        return json.loads(process.stdout.splitlines()[-1])

    return run


def test_a_registered_method_is_identified_with_by_its_name(run):
    result = run("""
        import json, sys
        import ankleloop
        from ankleloop.methods.registry import find_method, load_registered
        trial = ankleloop.simulate(seed=1, duration=20.0)
        K = ankleloop.identify(trial, "riv").stiffness["K"]
        not_loaded = "mine" not in sys.modules
        estimate = ankleloop.identify(trial, "twice", factor=3.0)
        errors = []
        for call in (
            lambda: ankleloop.identify(trial, "twice", factor=11.0),
            lambda: ankleloop.identify(trial, "twice", facto=1.0),
            lambda: ankleloop.identify(trial, "twic"),
        ):
            try:
                call()
            except (TypeError, ValueError) as error:
                errors.append(str(error))
        print(json.dumps({
            "not loaded": not_loaded, "ratio": estimate.stiffness["K"] / K, "method": estimate.method,
            "options": ankleloop.method_options("twice"), "errors": errors,
            "built-in wins": find_method("riv") is ankleloop.METHODS["riv"],
            "names": list(ankleloop.METHODS),
        }))
    """)
    assert result["not loaded"]
    assert result["built-in wins"]
    assert result["ratio"] == pytest.approx(3.0)
    assert result["method"] == "twice"
    assert result["options"] == {"identification_rate": 100.0, "factor": 2.0}
    assert "twice" not in result["names"]
    bounds, name, unknown = result["errors"]
    assert bounds == "method 'twice': factor must be between 0 and 10, got 11.0."
    assert "has no option 'facto' (did you mean 'factor'?)" in name
    assert "unknown method 'twic' (did you mean 'twice'?); known: riv, " in unknown
    assert ", twice. The methods 'broken' of " in unknown
    for entry in ("broken", "wrong"):
        assert f"The methods {entry!r} of the package mine==1.0 cannot be loaded (" in unknown


def test_a_study_and_the_command_take_a_registered_method(run):
    settings = {"twice": {"method": "twice", "options": {"factor": 3.0}}}
    result = run(f"""
        import json
        from pathlib import Path
        import jsonschema
        from ankleloop_lab.command_line.analysis import plan_analysis
        from ankleloop_workflow.config.settings import schema_text
        from ankleloop_lab.recordings.settings import Recording
        from ankleloop_workflow.config.study import read_studies
        def read(name, **options):
            method = {{"method": name, "options": options}}
            config = {{"studies": {{"s": {STUDY!r} | {{"methods": {{"a": method}}}}}}}}
            jsonschema.validate(config, json.loads(schema_text()))
            return read_studies(config)[1]["s"]
        errors = []
        for name, options in (("twice", {{"factor": 11.0}}), ("twice", {{"facto": 1.0}}), ("twic", {{}})):
            try:
                read(name, **options)
            except ValueError as error:
                errors.append(str(error))
        study = read("twice")
        chosen = plan_analysis("r", Path("r.csv"), Recording(file="r.csv"), ["twice"], {{"factor": 3.0}})
        print(json.dumps({{
            "methods": study.identified_methods, "points": list(study.points), "errors": errors,
            "chosen": chosen.methods,
        }}))
    """)
    assert result["methods"]["a"]["method"] == "twice"
    assert result["points"] == ["a.factor=2.0", "a.factor=3.0"]
    assert result["chosen"]["twice"]["options"]["factor"] == settings["twice"]["options"]["factor"]
    bounds, name, unknown = result["errors"]
    place = "config → studies → s → methods → a"
    assert bounds == f"{place}: options → factor: must be between 0 and 10, got 11.0."
    assert name.startswith(f"{place}: options: unknown key 'facto' (did you mean 'factor'?)")
    assert unknown.startswith(f"{place} → method: unknown method 'twic' (did you mean 'twice'?)")


def test_jobs_that_identify_know_the_version_of_the_package(run):
    code = """
        import json, sys
        from ankleloop_workflow.jobs.fingerprint import fingerprint
        scripts = ("identify", "recordings", "simulate")
        print(json.dumps({name: fingerprint(f"workflow/scripts/{name}.py") for name in scripts}))
    """
    first, second = run(code), run(code, version="1.1")
    assert first == run(code)
    assert first["simulate"] == second["simulate"]
    for name in ("identify", "recordings"):
        assert first[name] != second[name]
