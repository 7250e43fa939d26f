"""Values of MATLAB's classes: tables, times, objects, and those of the class nldat, in v7 and v7.3."""

import numpy as np
import pandas as pd
import pytest
from matio import save_to_mat
from matio.utils.matclass import MatlabOpaque
from scipy.io import savemat
from scipy.io.matlab import MatlabObject

from ankleloop.errors import DataError
from ankleloop_lab.files.reading import read_trial

RATE = 500.0
TIME = np.arange(300) / RATE
P = 0.02 * np.sin(np.arange(300) / 10)
TQ = 3.0 * np.cos(np.arange(300) / 10)
NANOSECONDS = np.round(1e9 * TIME).astype("timedelta64[ns]")
PLAIN = {"position": P[:, None], "torque": TQ[:, None]}
FS = np.array([[RATE]])
TABLE = pd.DataFrame({"angle": P, "torque": TQ})

pytestmark = pytest.mark.filterwarnings("ignore")  # of the writer


@pytest.fixture(params=["v7", "v7.3"])
def write(request, tmp_path):
    """Write variables to a file of each version that has objects."""

    def write(**variables):
        save_to_mat(tmp_path / "a.mat", variables, version=request.param)
        return tmp_path / "a.mat"

    return write


def cell(*values):
    array = np.empty((1, len(values)), dtype=object)
    array[0, :] = values
    return array


def nldat(names=("pos", "tq"), units=("rad", "Nm"), samples=None, **changes):
    properties = {
        "chanNames": cell(*[np.array([name]) for name in names]),
        "chanUnits": cell(*[np.array([unit]) for unit in units]),
        "domainIncr": np.array([[1.0 / RATE]]),
        "domainName": np.array(["Time (s)"]),
        "domainValues": np.array([[np.nan]]),
        "dataSet": np.column_stack([P, TQ]) if samples is None else samples,
        "comment": np.array(["relaxed"]),
    }
    return MatlabOpaque(properties | changes, "nldat")


def assert_signals(trial):
    np.testing.assert_allclose(trial["position"], P, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(trial["torque"], TQ, rtol=1e-12)
    assert trial.attrs["sampling_rate"] == RATE


BESIDE = {
    "string": np.array(["rest"], dtype=np.dtypes.StringDType()),
    "datetime": np.array([["2026-01-31"]], dtype="datetime64[ns]"),
    "categorical": pd.Categorical(["rest", "active"]),
    "object": MatlabOpaque({"owner": np.array(["S1"])}, "subject"),
}


@pytest.mark.parametrize("kind", BESIDE)
def test_a_value_of_a_class_beside_the_channels(write, kind):
    assert_signals(read_trial(write(**PLAIN, fs=FS, note=BESIDE[kind])))


HOLDERS = {
    "table": ({"T": TABLE, "fs": FS}, "T.angle"),
    "table in a struct": ({"S": {"T": TABLE, "fs": FS}}, "S.T.angle"),
    "timetable": ({"T": TABLE.set_index(pd.TimedeltaIndex(NANOSECONDS))}, "T.angle"),
    "dates": ({"T": TABLE.set_index(pd.Timestamp("2026-01-31") + NANOSECONDS)}, "T.angle"),
    "object": ({"r": MatlabOpaque({**PLAIN, "fs": FS}, "recording")}, "r.position"),
    "duration": ({**PLAIN, "time": NANOSECONDS[:, None]}, "position"),
    "nldat": ({"z": nldat()}, "z.pos"),
    "nldat, single precision": (
        {"z": nldat(domainIncr=np.array([[float(np.float32(1.0 / RATE))]]))},
        "z.pos",
    ),
    "nldat, ms": (
        {"z": nldat(domainName=np.array(["Time (ms)"]), domainIncr=np.array([[1e3 / RATE]]))},
        "z.pos",
    ),
    "nldat, times": ({"z": nldat(domainValues=TIME[:, None])}, "z.pos"),
    "nldat, degrees": (
        {"z": nldat(units=("deg", "Nm"), samples=np.column_stack([np.degrees(P), TQ]))},
        "z.pos",
    ),
    "nldat, unstated": ({"z": nldat(units=("Default Units",))}, "z.pos"),
}


@pytest.mark.parametrize("kind", HOLDERS)
def test_channels_in_a_value(write, kind):
    variables, position = HOLDERS[kind]
    trial = read_trial(write(**variables))
    assert_signals(trial)
    assert trial.attrs["position_variable"] == position


def test_elements_of_arrays_of_values(write):
    path = write(C=cell(TABLE, TABLE), Z=cell(nldat(), nldat()), fs=FS)
    assert_signals(read_trial(path, position="C[1].angle"))
    assert_signals(read_trial(path, position="Z[0].pos"))


@pytest.mark.parametrize(
    ("units", "fault"),
    [
        (("rad", "V"), "z.tq is in 'V' according to the file"),
        (("deg",), "z.tq is in 'deg' according to the file"),
        (("Nm",), "z.pos is in 'N·?m' according to the file"),
    ],
)
def test_units_of_nldat_that_are_others(write, units, fault):
    with pytest.raises(DataError, match=fault):
        read_trial(write(z=nldat(units=units)))


def test_channels_of_nldat_without_names_of_their_own(write):
    path = write(z=nldat(names=("ch", "ch")))
    assert_signals(read_trial(path, position="z.dataSet[:, 0]", torque="z.dataSet[:, 1]"))
    with pytest.raises(DataError, match=r"the file has: z.dataSet \(300, 2\).*'z.dataSet\[:, 0\]'"):
        read_trial(path)


def test_realizations_of_nldat(write):
    samples = np.stack([np.column_stack([-P, -TQ]), np.column_stack([P, TQ])], axis=-1)
    path = write(z=nldat(samples=samples))
    assert_signals(read_trial(path, position="z.pos[:, 1]", torque="z.tq[:, 1]"))
    with pytest.raises(DataError, match=r"z.pos \(300, 2\) is no single channel"):
        read_trial(path)


def test_an_object_of_a_class_of_old(tmp_path):
    fields = nldat().properties
    struct = np.zeros((1, 1), dtype=[(name, object) for name in fields])
    struct[0, 0] = tuple(fields.values())
    savemat(tmp_path / "a.mat", {"z": MatlabObject(struct, "nldat")})
    assert_signals(read_trial(tmp_path / "a.mat"))


def test_another_object_has_another_trial(write):
    """The reference of z2 is none of z1, and a choice of the position chooses the object."""
    samples = np.column_stack([2.0 * P, 2.0 * TQ, P])
    three = nldat(("pos", "tq", "cmd"), ("rad", "Nm", "rad"), samples)
    path = write(z1=nldat(("pos1", "tq1")), z2=three)
    with pytest.raises(DataError, match=r"may be the position: z1.pos1, z2.pos.*z1.tq1.*z2.cmd"):
        read_trial(path)
    trial = read_trial(path, position="z1.pos1")
    assert_signals(trial)
    assert "reference" not in trial
    assert read_trial(path, position="z2.pos").attrs["reference_variable"] == "z2.cmd"
