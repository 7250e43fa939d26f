"""Round trips: another program reads the numbers of the estimate."""

import numpy as np
import pandas as pd
import pytest

from ankleloop import DataError, identify, load_estimate, simulate
from ankleloop.recordings.files import export_estimate


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=20.0)


@pytest.fixture(scope="module", params=["riv", "pr-moesp", "parallel-cascade"])
def estimate(request, trial):
    return identify(trial, request.param, basis="rectifier")


def test_exports_are_the_files_of_save_estimate(estimate, trial, tmp_path):
    for suffix in (".nc", ".mat"):
        export_estimate(estimate, tmp_path / f"e{suffix}")
        loaded = load_estimate(tmp_path / f"e{suffix}")
        assert loaded.predict(trial).torque.identical(estimate.predict(trial).torque)


def test_csv_and_other_suffixes(estimate, tmp_path):
    export_estimate(estimate, tmp_path / "e.csv")
    exported = pd.read_csv(tmp_path / "e.csv")
    assert list(exported) == ["time_s", "torque_net_nm", "torque_intrinsic_nm", "torque_reflex_nm"]
    np.testing.assert_allclose(exported["torque_reflex_nm"], estimate.torque["reflex"], rtol=1e-12)
    with pytest.raises(DataError, match=r"e.xlsx: estimates are exported as .nc, .mat, .csv; got .xlsx"):
        export_estimate(estimate, tmp_path / "e.xlsx")
    assert [path.name for path in tmp_path.iterdir()] == ["e.csv"]
