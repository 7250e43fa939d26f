"""Files of one estimate: everything of it comes back, and whatever is not such a file is refused."""

import numpy as np
import pytest
import scipy.io
import xarray as xr
from value_comparison import assert_same_estimate

from ankleloop import DataError, identify, load_estimate, save_estimate, simulate
from ankleloop.methods.registry import JOINT_METHODS

CASES = {method: (method, {}) for method in JOINT_METHODS}
CASES |= {
    "riv all": ("riv", {"delay": None, "order": 3, "basis": "spline", "identification_rate": 50.0}),
    "moesp free": ("pr-moesp", {"free_b": True, "input_matrices": "instruments", "order": None}),
    "moesp omitted step": ("pr-moesp", {"omitted_step": "early-nonlinearity", "basis": "spline"}),
    "selection": ("pr-moesp", {"select": {"basis": ["rectifier"], "order": [1, 2]}}),
}
CONTAINERS = (".nc", ".mat")


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=20.0)


@pytest.fixture(scope="module")
def other():
    """A trial of another length, rate, mean and amplitude."""
    other = (
        simulate(seed=2, duration=16.0)
        .isel(time=slice(0, None, 2))
        .assign_attrs(sampling_rate=500.0)
    )
    return other.assign(position=0.7 * other["position"] + 0.3)


@pytest.fixture(scope="module")
def fitted(trial):
    return identify(trial, "pr-moesp")


@pytest.fixture(scope="module", params=CASES)
def estimate(request, trial):
    method, options = CASES[request.param]
    return identify(trial, method, **options)


@pytest.mark.parametrize("container", CONTAINERS)
def test_everything_of_an_estimate_comes_back(estimate, container, other, tmp_path):
    save_estimate(estimate, tmp_path / f"e{container}")
    loaded = load_estimate(str(tmp_path / f"e{container}"))
    assert_same_estimate(loaded, estimate)
    if estimate.predictor is None:
        words = f"{estimate.method} has no fixed model to predict with"
        with pytest.raises(DataError, match=words):
            loaded.predict(other)
        return
    prediction = loaded.predict(other).torque
    assert prediction.identical(estimate.predict(other).torque)
    has_reflex = estimate.method != "apparatus"
    assert np.ptp(prediction["reflex" if has_reflex else "intrinsic"].values) > 0
    assert prediction["time"][-1] < 16.0


def rewrite(path, change):
    """The file with its groups changed."""
    with xr.open_datatree(path, engine="h5netcdf") as tree:
        groups = {name.strip("/"): data.load() for name, data in tree.to_dict().items()}
    changed = {f"/{name}": data for name, data in change(groups).items()}
    xr.DataTree.from_dict(changed).to_netcdf(path, engine="h5netcdf")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda g: {k: v for k, v in g.items() if k != "stiffness"},
            r"e.nc: not a readable .*'stiffness'",
        ),
        (
            lambda g: g | {"model": g["model"].assign_attrs(kind="oracle")},
            r"e.nc: not a readable .*'oracle'",
        ),
        (
            lambda g: g | {"model": g["model"].assign_attrs(basis="sigmoid")},
            r"e.nc, group model: the basis 'sigmoid' is unknown to ankleloop 0.*install the newest",
        ),
        (
            lambda g: g | {"model": g["model"].assign(A=np.nan * g["model"]["A"])},
            r"e.nc: not .*'A' is not finite",
        ),
        (
            lambda g: g | {"diagnostics": g["diagnostics"].assign_attrs(json="{")},
            r"e.nc: not a readable estimate file .*: restore it from a copy",
        ),
    ],
)
def test_damaged_files_are_refused_with_what_is_missing(fitted, tmp_path, change, message):
    save_estimate(fitted, tmp_path / "e.nc")
    rewrite(tmp_path / "e.nc", change)
    with pytest.raises(DataError, match=message):
        load_estimate(tmp_path / "e.nc")


def test_foreign_and_truncated_matlab_files_are_refused(fitted, tmp_path):
    path = tmp_path / "e.mat"
    save_estimate(fitted, path)
    half = path.read_bytes()[: path.stat().st_size // 2]
    v73 = b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + 500 * b" "
    for content, message in ((half, "not a readable .mat file"), (v73, "not a readable .mat file")):
        path.write_bytes(content)
        with pytest.raises(DataError, match=f"e.mat: {message}"):
            load_estimate(path)
    scipy.io.savemat(path, {"position": np.ones(3)})
    with pytest.raises(DataError, match=r"e.mat: not a readable .mat file \(KeyError: 'estimate'"):
        load_estimate(path)


def test_a_matlab_file_that_matlab_has_written_again_is_read(trial, other, tmp_path):
    """MATLAB keeps numbers as doubles, vectors as rows or columns, and texts as they are."""
    estimate = identify(trial, "riv", delay=None)
    save_estimate(estimate, tmp_path / "e.mat")
    struct = scipy.io.loadmat(tmp_path / "e.mat", simplify_cells=True)["estimate"]
    scipy.io.savemat(
        tmp_path / "again.mat", {"estimate": struct}, long_field_names=True, oned_as="row"
    )
    loaded = load_estimate(tmp_path / "again.mat")
    assert loaded.predict(other).torque.identical(estimate.predict(other).torque)
