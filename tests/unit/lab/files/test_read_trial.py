"""Trials from files: formats, names, units, signs and sampling rates."""

import gzip

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import xarray as xr

from ankleloop import identify, new_trial, save_trial, simulate
from ankleloop.errors import DataError
from ankleloop.trials.channels import TRUE_TORQUES
from ankleloop_lab.files.reading import read_trial

RATE = 500.0
T = np.arange(300) / RATE
P = 0.02 * np.sin(2 * np.pi * 3 * T)
TQ = 3.0 * np.cos(2 * np.pi * 3 * T)
R = 0.02 * np.sign(P + 1e-9)


def assert_signals(trial, rate=RATE, rtol=0.0):
    np.testing.assert_allclose(trial.position, P, rtol=rtol)
    np.testing.assert_allclose(trial.torque, TQ, rtol=rtol)
    assert trial.attrs["sampling_rate"] == rate


def write_csv(path, **columns):
    pd.DataFrame({"time": T, "position": P, "torque": TQ} | columns).to_csv(path, index=False)
    return path


def write_v73(path, tree):
    """An HDF5 file as MATLAB writes it: a header in a user block, arrays transposed, structs as groups."""

    def write(group, name, value):
        if isinstance(value, dict):
            struct = group.create_group(name)
            struct.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, item in value.items():
                write(struct, key, item)
            return
        group[name] = np.atleast_2d(np.asarray(value, float))
        group[name].attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in tree.items():
            write(file, name, value)
        file.create_group("#refs#")["a"] = np.zeros((1, 2))
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


# --- every container


def write_hdf5(path, root_of_rate="/", name_of_rate="sampling_rate", group=""):
    with h5py.File(path, "w") as file:
        file[f"{group}position"], file[f"{group}torque"] = P, TQ[None, :]
        file[f"{group}position"].attrs["units"] = "rad"
        file["other/fs"] = 1.0
        file[root_of_rate].attrs[name_of_rate] = RATE
    return path


def write_netcdf(path, **options):
    data = xr.Dataset({"position": ("t", P), "torque": ("t", TQ)}, coords={"t": T})
    data.to_netcdf(path, **options)


def write_mat(path, **options):
    scipy.io.savemat(path, {"position": P, "torque": TQ, "fs": RATE}, **options)


@pytest.mark.parametrize(
    ("name", "write"),
    {
        "pandas.csv": write_csv,
        "v4.mat": lambda path: write_mat(path, format="4"),
        "v73.mat": lambda path: write_v73(
            path, {"position": P[None, :], "torque": TQ[:, None], "fs": RATE}
        ),
        "a.h5": write_hdf5,
        "a.hdf5": write_hdf5,
        "v4.nc": lambda path: write_netcdf(path, engine="h5netcdf"),
        "classic.nc": lambda path: write_netcdf(path, engine="scipy"),
    }.items(),
)
def test_containers(tmp_path, name, write):
    write(tmp_path / name)
    assert_signals(read_trial(tmp_path / name))


# --- which variables are the channels


@pytest.mark.parametrize(
    ("position", "torque", "reference"),
    [
        ("position", "torque", "reference"),
        ("ankle_angle_rad", "AnkleMoment", "cmd"),
        ("theta", "tq", "angle_command"),
        ("ankle_angle_r", "ankle_angle_r_moment", "target"),
    ],
)
def test_channels_by_their_names(tmp_path, position, torque, reference):
    columns = {"time": T, position: P, torque: TQ, reference: R, "emg": TQ}
    columns |= {"angle_velocity": P, "theta_dot": P, "pos_vel": P, "angle_acc": P}
    pd.DataFrame(columns).to_csv(tmp_path / "trial.csv", index=False)
    scipy.io.savemat(tmp_path / "trial.mat", {"rec": columns})
    write_v73(tmp_path / "v73.mat", {"rec": columns})
    for name in ("trial.csv", "trial.mat", "v73.mat"):
        trial = read_trial(tmp_path / name, torque_sign=-1)
        for channel, expected in {"position": P, "torque": -TQ, "reference": R}.items():
            np.testing.assert_allclose(trial[channel], expected, rtol=1e-15)
        assert trial.attrs["reference_variable"].endswith(reference)
        named = read_trial(tmp_path / name, reference=trial.attrs["reference_variable"])
        assert named.reference.identical(trial.reference)
        assert "reference" not in read_trial(tmp_path / name, reference="none")


def test_a_trial_from_a_file_is_identified_as_it_is(tmp_path):
    """The line of the README: the reference is found, so that `identify` needs no more."""
    simulated = simulate(seed=1, duration=20.0)
    table = simulated[["position", "torque", "reference"]].to_dataframe().reset_index()
    table.assign(torque=-table["torque"]).to_csv(tmp_path / "trial.csv", index=False)
    estimate = identify(read_trial(tmp_path / "trial.csv", torque_sign=-1))
    expected = identify(simulated)
    assert estimate.method == expected.method == "riv"
    assert estimate.stiffness == pytest.approx(expected.stiffness, rel=1e-6)


@pytest.mark.parametrize(
    ("columns", "words", "options"),
    [
        ({"angle": P}, "2 variables may be the position: position, angle;", {"position": "angle"}),
        ({"left_tq": TQ}, "2 variables may be the torque: torque, left_tq;", {"torque": "left_tq"}),
        ({"ref": R, "cmd": P}, "2 variables may be the reference: ref, cmd;", {"reference": "cmd"}),
    ],
)
def test_channels_of_which_there_are_several_are_not_guessed(tmp_path, columns, words, options):
    path = write_csv(tmp_path / "a.csv", **columns)
    with pytest.raises(
        DataError, match=f"^a.csv: {words} the file has: time, .* Name one of these"
    ):
        read_trial(path)
    assert_signals(read_trial(path, **options))


def test_variables_that_are_something_else_leave_no_choice(tmp_path):
    path = write_csv(tmp_path / "a.csv", angle=R, target=R, torque_noise=TQ)
    trial = read_trial(path, variables={"knee": "angle", "light": "target"})
    assert_signals(trial)
    assert "reference" not in trial
    turned = read_trial(path, position="target", reference="/position", torque="torque")
    np.testing.assert_array_equal(turned.reference, P)


def test_single_numbers_and_empty_variables_are_no_channels(tmp_path):
    columns = {"position": P, "torque": TQ, "ref": 1.0, "command": [], "fs": RATE}
    scipy.io.savemat(tmp_path / "a.mat", columns)
    assert "reference" not in read_trial(tmp_path / "a.mat")


# --- CSV


def test_text_in_a_cell_is_located_by_its_line(tmp_path):
    with gzip.open(tmp_path / "a.csv.gz", "wt") as file:
        file.write("position,torque\n\n\n0,1\n0.01,n.v.t.\n0,1\n")
    with pytest.raises(DataError, match=r"^a.csv.gz: torque is not a number in line 5 but 'n.v.t"):
        read_trial(tmp_path / "a.csv.gz", sampling_rate=RATE)


# --- MATLAB


@pytest.mark.parametrize("write", [scipy.io.savemat, write_v73])
def test_structs_of_matlab(tmp_path, write):
    ankle = {"pos": P, "tq": TQ, "cmd": R}
    write(tmp_path / "a.mat", {"rec": {"ankle": ankle, "Fs": RATE}, "fs": 1.0})
    names = {"position": "rec.ankle.pos", "torque": "rec.ankle.tq", "reference": "rec.ankle.cmd"}
    assert_signals(read_trial(tmp_path / "a.mat", **names))
    assert_signals(read_trial(tmp_path / "a.mat"))  # by their names
    with pytest.raises(DataError, match=r"no variable 'rec.pos'; the file has: .*rec.ankle.pos, "):
        read_trial(tmp_path / "a.mat", position="rec.pos")


def test_structs_of_any_shape_beside_the_channels(tmp_path):
    cells = np.array([{"a": P}, np.array([{"a": P}, {"a": P}], dtype=object)], dtype=object)
    scipy.io.savemat(tmp_path / "a.mat", {"rec": {"pos": P, "tq": TQ, "Fs": RATE, "cells": cells}})
    assert_signals(read_trial(tmp_path / "a.mat"))


# --- HDF5


@pytest.mark.parametrize("owner", ["trial/ankle/position", "trial/ankle", "trial", "/"])
@pytest.mark.parametrize("name", ["fs", "Fs", "sampling_rate", "sample_rate"])
def test_hdf5_groups_and_their_rate(tmp_path, owner, name):
    path = write_hdf5(tmp_path / "a.h5", owner, name, "trial/ankle/")
    assert_signals(read_trial(path, position="/trial/ankle/position", torque="trial/ankle/torque"))


# --- NetCDF


def test_true_torques_of_a_netcdf_trial(tmp_path):
    true_torques = {name: (k + 2) * TQ for k, name in enumerate(TRUE_TORQUES)}
    save_trial(new_trial(P, TQ, RATE, R, **true_torques, seed=1), tmp_path / "a.nc")
    trial = read_trial(tmp_path / "a.nc", reference="reference", torque_sign=-1, position_sign=-1)
    for name, values in ({"position": P, "torque": TQ, "reference": R} | true_torques).items():
        np.testing.assert_array_equal(trial[name], -values)
    assert "reference" not in read_trial(tmp_path / "a.nc", reference="none")


# --- units and signs


@pytest.mark.parametrize(
    ("attributes", "shown"),
    [
        ({"UNITS": "grad"}, "grad"),
        ({"units": 57}, "57"),
        ({"unit": "deg", "units": "rad"}, "deg and rad"),
    ],
)
def test_units_in_unusual_forms_are_not_taken_for_rad(tmp_path, attributes, shown):
    path = write_hdf5(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        file["torque"].attrs.update(unit="Nm", units="N·m")
    assert_signals(read_trial(path))
    with h5py.File(path, "a") as file:
        file["position"].attrs.clear()
        file["position"].attrs.update(attributes)
    with pytest.raises(DataError, match=rf"a.h5: position is in '{shown}' according to the file"):
        read_trial(path)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *((name, "") for name in ("angle_deg", "angle [deg]", "angle (Degrees)")),
        *(("angle", unit) for unit in ("deg", "Degrees", b"degree", "°")),
    ],
)
def test_the_unit_that_the_file_states(tmp_path, name, unit):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.update({name: np.rad2deg(P), "torque": TQ, "command": np.rad2deg(R), "fs": RATE})
        file[name].attrs["unit"] = unit
    trial = read_trial(tmp_path / "a.h5")
    assert_signals(trial, rtol=1e-15)
    np.testing.assert_allclose(trial.reference, R, rtol=1e-15)
    assert trial.attrs["position_unit_of_file"] == "deg"
    with pytest.raises(DataError, match=r"is in '.*' .*, but position_unit is 'rad'"):
        read_trial(tmp_path / "a.h5", position_unit="rad")


def test_attributes_record_the_options(tmp_path):
    path = write_csv(tmp_path / "a.csv", angle=np.rad2deg(P))
    trial = read_trial(
        path, position="angle", position_unit="deg", position_sign=-1, torque_sign=-1
    )
    assert trial.attrs == {
        "sampling_rate": RATE,
        "source": "a.csv",
        "position_variable": "angle",
        "torque_variable": "torque",
        "position_unit": "rad",
        "position_unit_of_file": "deg",
        "torque_unit_of_file": "N·m",
        "position_sign": -1,
        "torque_sign": -1,
    }
    assert trial.position.attrs["units"] == "rad"


# --- sampling rate and time


def test_a_stated_rate_settles_what_the_file_does_not_say(tmp_path):
    columns = {"position": P, "torque": TQ}
    scipy.io.savemat(tmp_path / "a.mat", {**columns, "fs": "fast"})
    scipy.io.savemat(tmp_path / "b.mat", {**columns, "fs": RATE / 10, "Fs": RATE})
    for name in ("a.mat", "b.mat"):
        assert_signals(read_trial(tmp_path / name, sampling_rate=RATE))


def test_torque_variable_t_is_not_the_time(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"p": P, "t": TQ, "fs": RATE})
    assert_signals(read_trial(tmp_path / "a.mat", position="p", torque="t"))


# --- further variables


def test_further_variables(tmp_path):
    """They keep their numbers and their unit, whatever the position has."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.update({"angle": np.rad2deg(P), "torque": TQ, "knee": 30.0 + P, "fs": RATE})
        file["knee"].attrs["units"] = "degrees of the knee"
    options = {"position_unit": "deg", "position_sign": -1}
    trial = read_trial(tmp_path / "a.h5", variables={"knee_angle": "knee"}, **options)
    np.testing.assert_allclose(trial["position"], -P)
    np.testing.assert_array_equal(trial["knee_angle"], 30.0 + P)
    assert trial["knee_angle"].attrs["units"] == "degrees of the knee"
    assert trial.attrs["knee_angle_variable"] == "knee"
    with pytest.raises(DataError, match="hip"):
        read_trial(tmp_path / "a.h5", variables={"hip_angle": "hip"}, **options)
