"""One notation for parts of variables: columns, rows, elements, fields, in every container."""

import re

import h5py
import numpy as np
import pytest
import scipy.io
import xarray as xr
from matio import save_to_mat

from ankleloop.errors import DataError
from ankleloop_lab.files.reading import read_trial
from ankleloop_lab.files.reading_options import ReadingOptions, list_trials

RATE = 500.0
TIME = np.arange(300) / RATE
P = 0.02 * np.sin(np.arange(300) / 10)
TQ = 3.0 * np.cos(np.arange(300) / 10)
COLUMNS = np.column_stack([TIME, P, TQ])
ROWS = {"position": np.stack([-P, P]), "torque": np.stack([-TQ, TQ])}


def write_matlab(path, variables):
    """A MATLAB v7.3 file, which has the axes of a matrix in reverse."""
    arrays = {name: np.atleast_2d(values) for name, values in variables.items()}
    save_to_mat(path, arrays, version="v7.3")


def write_hdf5(path, variables):
    with h5py.File(path, "w") as file:
        for name, values in variables.items():
            file[name] = values


def write_netcdf(engine):
    def write(path, variables):
        dims = {name: [f"{name}{k}" for k in range(np.ndim(v))] for name, v in variables.items()}
        data = {name: (dims[name], values) for name, values in variables.items()}
        xr.Dataset(data).to_netcdf(path, engine=engine)

    return write


WRITERS = {
    "v5.mat": scipy.io.savemat,
    "v73.mat": write_matlab,
    "a.h5": write_hdf5,
    "classic.nc": write_netcdf("scipy"),
    "a.nc": write_netcdf("h5netcdf"),
}


@pytest.fixture(params=WRITERS)
def write(request, tmp_path):
    """Write variables to a file of each container."""

    def write(**variables):
        WRITERS[request.param](tmp_path / request.param, variables)
        return tmp_path / request.param

    return write


def assert_signals(trial, factor=1.0):
    np.testing.assert_allclose(trial["position"], factor * P, rtol=1e-12)
    np.testing.assert_allclose(trial["torque"], factor * TQ, rtol=1e-12)
    assert trial.attrs["sampling_rate"] == RATE


def test_columns_of_a_matrix(write):
    path = write(data=COLUMNS, fs=RATE)
    trial = read_trial(path, position="data[:,1]", torque="data[:, 2]")
    assert_signals(trial)
    assert trial.attrs["position_variable"] == "data[:, 1]"
    with pytest.raises(DataError, match=r"the file has: data \(300, 3\).*'data\[:, 0\]'") as e:
        read_trial(path)
    assert e.value.remedy == {"position": None}


def test_trials_in_rows(write):
    path = write(**ROWS, fs=RATE)
    assert_signals(read_trial(path, position="position[1, :]", torque="torque[1]"))
    with pytest.raises(DataError, match=r"position \(2, 300\) is no single channel") as e:
        read_trial(path)
    assert_signals(read_trial(path, **e.value.remedy), -1.0)
    options = ReadingOptions(position="position[*, :]", torque="torque[*, :]")
    second = list_trials(path, options)[1]
    assert second.channels == {"position": "position[1, :]", "torque": "torque[1, :]"}


@pytest.mark.parametrize("part", ["data[:, 3]", "data[:, -1]", "data[:, 1, 0]", "data[x]"])
def test_parts_that_do_not_exist(write, part):
    path = write(data=COLUMNS, fs=RATE)
    with pytest.raises(
        DataError, match=r"no variable 'data\[.*: data \(300.* counted from 0, and not from the end"
    ):
        read_trial(path, position=part, torque="data[:, 2]")


def test_fields_of_records(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        records = np.rec.fromarrays([TIME, P, TQ], names="time,ankle_angle,moment")
        file["run/table"] = records
    assert_signals(read_trial(tmp_path / "a.h5"))
    named = read_trial(tmp_path / "a.h5", position="run/table.ankle_angle")
    assert named.attrs["torque_variable"] == "run/table.moment"


def write_trials(path, count):
    """A struct array of trials, the last of which has the signals."""
    trials = np.zeros((1, count), dtype=[("pos", object), ("tq", object), ("fs", object)])
    for number in range(count):
        factor = 1.0 if number == count - 1 else -1.0
        trials[0, number] = (factor * P, factor * TQ, RATE)
    scipy.io.savemat(path, {"trial": trials})
    return path


def test_elements_of_a_struct_array(tmp_path):
    path = write_trials(tmp_path / "a.mat", 3)
    # The torque is that of the same trial.
    assert_signals(read_trial(path, position="trial[2].pos"))
    with pytest.raises(DataError, match=r"trial\[\*\].pos \(3 of \(1, 300\)\)") as e:
        read_trial(path)
    assert e.value.remedy == {"position": "trial[0].pos", "torque": "trial[0].tq"}
    with pytest.raises(DataError, match=r"there is no variable 'trial\[3\].pos'; the file has: tr"):
        read_trial(path, position="trial[3].pos", torque="trial[2].tq")
    assert_signals(read_trial(write_trials(tmp_path / "b.mat", 1)))


def test_elements_of_a_cell_array(tmp_path):
    cells = {name: np.empty(2, dtype=object) for name in ("angle_deg", "torque")}
    cells["angle_deg"][:] = [np.degrees(-P), np.degrees(P)]
    cells["torque"][:] = [-TQ, TQ]
    scipy.io.savemat(tmp_path / "a.mat", {**cells, "fs": RATE})
    options = ReadingOptions(position="angle_deg[*]", torque="torque[*]")
    trials = list_trials(tmp_path / "a.mat", options)
    for factor, trial in zip((-1.0, 1.0), trials, strict=True):
        assert_signals(read_trial(tmp_path / "a.mat", **trial.channels), factor)


def test_channels_of_different_numbers_of_trials(tmp_path):
    path = write_trials(tmp_path / "a.mat", 3)
    options = ReadingOptions(position="trial[*].pos", torque="trial[0].tq")
    with pytest.raises(DataError, match=r"different numbers of trials: \{1, 3\}\.$"):
        list_trials(path, options)


def test_a_further_variable_may_be_a_part():
    options = ReadingOptions(variables="knee=data[:, 3],phase=x")
    assert options.further == {"knee": "data[:, 3]", "phase": "x"}


def test_one_part_in_two_spellings():
    with pytest.raises(ValueError, match="position and torque are the same variable"):
        ReadingOptions(position="data[:, 2]", torque="data[:,2]")


@pytest.mark.parametrize("name", ["position", "torque_reflex"])
def test_a_single_number_is_no_channel(write, name):
    path = write(**{"position": P, "torque": TQ, "fs": RATE, name: np.float64(3.0)})
    for stated in (None, "position"):
        with pytest.raises(
            DataError, match=r"(no variable is called|has 1 sample|but position has 1)"
        ):
            read_trial(path, position=stated)


@pytest.mark.parametrize("hole", [0, 1, 3])
def test_an_empty_cell_hides_no_trial(tmp_path, hole):
    """It is refused by its name, and those behind it are read."""
    cells = np.empty(4, dtype=object)
    for number in range(4):
        cells[number] = {"pos": P, "tq": TQ}
    cells[hole] = np.empty((0, 0))
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"trial": cells, "fs": RATE})
    options = ReadingOptions(position="trial[*].pos", torque="trial[*].tq")
    trials = list_trials(path, options)
    assert len(trials) == 4
    for number, trial in enumerate(trials):
        if number == hole:
            with pytest.raises(DataError, match=rf"no variable 'trial\[{hole}\].pos'"):
                read_trial(path, **trial.channels)
        else:
            assert_signals(read_trial(path, **trial.channels))


@pytest.mark.parametrize("write", [scipy.io.savemat, write_matlab])
@pytest.mark.parametrize("hole", [0, 1, 3])
def test_an_empty_element_is_refused_by_its_name(tmp_path, write, hole):
    """In a struct array and in arrays of cells; those behind it are read."""
    trials = np.zeros((1, 4), dtype=[("pos", object), ("tq", object)])
    for number in range(4):
        trials[0, number] = (P[None], TQ[None])
    trials[0, hole]["pos"] = np.empty((0, 0))
    cells = {"angle": trials["pos"], "moment": trials["tq"]}
    path = tmp_path / "a.mat"
    write(path, {"trial": trials, "fs": RATE, **cells})
    for position, torque in (("trial[*].pos", "trial[*].tq"), ("angle[*]", "moment[*]")):
        listed = list_trials(path, ReadingOptions(position=position, torque=torque))
        assert len(listed) == 4
        for number, trial in enumerate(listed):
            if number == hole:
                name = position.replace("*", str(hole))
                with pytest.raises(DataError, match=rf"{re.escape(name)} has no samples"):
                    read_trial(path, **trial.channels)
            else:
                assert_signals(read_trial(path, **trial.channels))
