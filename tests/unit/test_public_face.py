"""The public names, their arguments, and what importing them loads."""

import inspect
import pkgutil

import pytest

import ankleloop
from ankleloop.jobs.fingerprint import fingerprint
from ankleloop.simulation.settings import SimulationSettings


def test_every_public_name_exists():
    for name in ankleloop.__all__:
        assert getattr(ankleloop, name) is not None
    assert set(dir(ankleloop)) == set(ankleloop.__all__)  # and nothing of how they are loaded
    assert callable(ankleloop.subspace.moesp)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        ankleloop.nothing  # noqa: B018


def test_settings_are_the_arguments_of_simulate():
    parameters = inspect.signature(ankleloop.simulate).parameters
    assert {p.kind for p in parameters.values()} == {inspect.Parameter.KEYWORD_ONLY}
    assert set(parameters) >= {"seed", "load", *SimulationSettings.model_fields}


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
