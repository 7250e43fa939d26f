"""The public names, their arguments, and what importing them loads."""

import inspect
import pkgutil
import subprocess
import sys
from operator import attrgetter

import pytest

import ankleloop
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.fingerprint import fingerprint

NAMES = {
    "METHODS",
    "DataError",
    "Estimate",
    "LongRecord",
    "UnstableLoopError",
    "block_bootstrap",
    "check_trial",
    "cramer_rao",
    "evaluate",
    "identify",
    "identify_file",
    "load_estimate",
    "load_trial",
    "method_options",
    "new_trial",
    "read_trial",
    "save_estimate",
    "save_trial",
    "segment",
    "simulate",
    "subspace",
    "trajectory_bound",
    "vaf",
}


def test_every_public_name_exists():
    assert set(ankleloop.__all__) == NAMES
    for name in ankleloop.__all__:
        assert getattr(ankleloop, name) is not None
        assert name in dir(ankleloop)
    assert callable(ankleloop.subspace.moesp)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        ankleloop.nothing  # noqa: B018


@pytest.mark.parametrize(
    ("name", "positional", "keyword_only"),
    [
        ("identify", "trial method", "select criterion"),
        ("identify_file", "record output method", "chunk overwrite progress"),
        ("evaluate", "trial estimate", "trim against intervals"),
        ("vaf", "measured estimated", ""),
        ("new_trial", "position torque sampling_rate reference", ""),
        (
            "read_trial",
            "path",
            "position torque reference sampling_rate position_unit position_sign torque_sign variables",
        ),
        ("load_estimate", "path", ""),
        ("load_trial", "path", ""),
        ("save_estimate", "estimate path", "overwrite"),
        ("save_trial", "trial path", "overwrite"),
        ("segment", "trial start stop", ""),
        ("check_trial", "trial", "reference delay order block_rows identification_rate"),
        ("cramer_rao", "", "seed identification_rate fed_back known_delay"),
        ("trajectory_bound", "", "seed knots identification_rate known_delay"),
        ("block_bootstrap", "trial method", "repetitions block seed progress"),
        ("method_options", "method", ""),
        (
            "LongRecord",
            "path sampling_rate position torque reference position_unit position_sign torque_sign variables",
            "",
        ),
        ("Estimate", "method torque matrices stiffness reflex intervals diagnostics predictor trajectories", ""),
        (
            "subspace.moesp",
            "u y block_rows order instruments projection reference dt",
            "instrument_rows instrument_leads input_matrices dynamic predicted_inputs compression rank_tolerance "
            "regression_tolerance names scaling offsets",
        ),
    ],
)
def test_arguments_of_the_public_functions(name, positional, keyword_only):
    parameters = inspect.signature(attrgetter(name)(ankleloop)).parameters.values()
    kinds = {kind: [p.name for p in parameters if p.kind is kind] for kind in inspect._ParameterKind}
    assert kinds[inspect.Parameter.POSITIONAL_ONLY] == []
    assert kinds[inspect.Parameter.POSITIONAL_OR_KEYWORD] == positional.split()
    assert sorted(kinds[inspect.Parameter.KEYWORD_ONLY]) == sorted(keyword_only.split())


def test_settings_are_the_arguments_of_simulate():
    parameters = inspect.signature(ankleloop.simulate).parameters
    assert {p.kind for p in parameters.values()} == {inspect.Parameter.KEYWORD_ONLY}
    assert set(parameters) >= {"seed", "load", *SimulationSettings.model_fields}


@pytest.mark.parametrize(
    ("statement", "unwanted"),
    [
        ("import ankleloop", ("numpy", "xarray", "numba", "scipy", "pydantic")),
        (
            "import ankleloop.records.trial_files, ankleloop.methods.registry",
            ("scipy.signal", "scipy.stats", "matplotlib", "control", "h5py"),
        ),
        (
            "import ankleloop; ankleloop.simulate, ankleloop.identify, ankleloop.evaluate",
            ("scipy.signal", "scipy.stats", "matplotlib", "control", "h5py"),
        ),
    ],
)
def test_a_job_loads_only_what_it_needs(statement, unwanted):
    code = f"import sys\n{statement}\nprint([name for name in {unwanted!r} if name in sys.modules])"
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert process.stdout.strip() == "[]"


def test_a_script_that_imports_the_package_depends_on_all_of_its_modules(tmp_path):
    """The package imports its modules at the first use of their names, which its source does not show."""
    modules = [module.name for module in pkgutil.walk_packages(ankleloop.__path__, "ankleloop.")]
    scripts = {
        "package": "import ankleloop",
        "all modules": "\n".join(f"import {name}" for name in ("ankleloop.__init__", *modules)),
        "one module": "import ankleloop.errors",
    }
    fingerprints = {}
    for name, text in scripts.items():
        (tmp_path / f"{name}.py").write_text(text)
        fingerprints[name] = fingerprint(tmp_path / f"{name}.py")
    assert fingerprints["package"] == fingerprints["all modules"] != fingerprints["one module"]
