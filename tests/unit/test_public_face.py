"""The public names, their arguments, and what importing them loads."""

import inspect
import subprocess
import sys

import pytest

import ankleloop
from ankleloop.simulation.settings import SimulationSettings


def test_settings_are_the_arguments_of_simulate():
    parameters = inspect.signature(ankleloop.simulate).parameters
    assert {p.kind for p in parameters.values()} == {inspect.Parameter.KEYWORD_ONLY}
    assert set(parameters) >= {"seed", "load", *SimulationSettings.model_fields}


NO_CLICK = """
import sys
sys.modules["click"] = None
import ankleloop
from ankleloop.__main__ import main
assert ankleloop.__version__
assert not {"numpy", "scipy", "xarray"} & set(sys.modules)
sys.exit(main())
"""


def test_without_the_packages_of_the_command_line_a_line_says_what_to_install():
    process = subprocess.run([sys.executable, "-c", NO_CLICK], capture_output=True, text=True)
    assert process.returncode == 3
    assert process.stderr.count("\n") == 1
    assert 'pip install "ankleloop[lab]"' in process.stderr


EACH = """
import ankleloop
for name in ankleloop.__all__:
    assert getattr(ankleloop, name).__doc__, name
"""


def test_every_public_name_is_there():
    """In a new interpreter, where no other test has imported its module."""
    subprocess.run([sys.executable, "-c", EACH], check=True)
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        ankleloop.simulat  # noqa: B018
