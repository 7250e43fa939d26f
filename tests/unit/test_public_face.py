import subprocess
import sys

import pytest

import ankleloop

from fingerprint import ROOT, _files


def test_every_public_name_is_there():
    for name in ankleloop.__all__:
        assert getattr(ankleloop, name) is not None
        assert name in dir(ankleloop)
    assert callable(ankleloop.identify)
    assert callable(ankleloop.subspace.moesp)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        ankleloop.nothing  # noqa: B018


@pytest.mark.parametrize(
    ("statement", "unwanted"),
    [
        ("import ankleloop", ("numpy", "xarray", "numba", "scipy")),
        (
            "import ankleloop.records.trial_files, ankleloop.methods.registry",
            ("scipy.signal", "scipy.stats", "matplotlib", "control", "h5py"),
        ),
    ],
)
def test_a_job_does_not_wait_for_what_it_does_not_need(statement, unwanted):
    code = f"import sys\n{statement}\nprint([name for name in {unwanted!r} if name in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"


def test_who_imports_the_package_depends_on_all_of_it():
    assert set(_files("ankleloop")) == set((ROOT / "src" / "ankleloop").rglob("*.py"))
    assert {path.name for path in _files("ankleloop.errors")} == {"errors.py"}
