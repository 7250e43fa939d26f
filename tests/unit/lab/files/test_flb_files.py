"""FLB files: every version and format, several cases, and what is damaged."""

import numpy as np
import pytest
from bad_inputs.flb_files import POSITION, RATE, TORQUE, flb_case

from ankleloop import DataError, read_trial
from ankleloop_lab.files.flb_files import FlbContents


def write(path, *cases):
    path.write_bytes(b"".join(cases))
    return path


@pytest.mark.parametrize("version", [2, 3, 4])
@pytest.mark.parametrize("kind", [2, -2, 4])
def test_every_version_and_format(tmp_path, version, kind):
    path = write(tmp_path / "S1.flb", flb_case(version, kind))
    scale = 1000.0 if kind == 2 else 1.0  # of its integers
    position_step, torque_step = {2: (5.1e-4, 0.51), -2: (2e-6, 1.3e-4), 4: (1e-8, 1e-6)}[kind]
    trial = read_trial(path, position_unit=1.0 / scale)
    np.testing.assert_allclose(trial.position, POSITION, atol=position_step)
    np.testing.assert_allclose(trial.torque, scale * TORQUE, atol=torque_step)
    assert trial.attrs["sampling_rate"] == RATE  # 0.001 s is rounded in the file


def test_cases_count_from_1(tmp_path):
    cases = flb_case(comment="relaxed"), flb_case(2, -2, scale=0.5), flb_case(names=("", "\xb5V"))
    path = write(tmp_path / "S1.flb", *cases)
    second = read_trial(path, case=2)
    np.testing.assert_allclose(second.torque, 0.5 * TORQUE, atol=2e-4)
    assert second.attrs["case"] == 2
    assert FlbContents(path, 3).names() == ["channel 1", "\xb5V"]
    with pytest.raises(
        DataError, match=r"choose one by the option case: case 1, 'relaxed'; case 2"
    ):
        read_trial(path)


def test_realizations_have_numbers(tmp_path):
    path = write(tmp_path / "S1.flb", flb_case(realizations=2))
    assert FlbContents(path).names() == ["POS/1", "TQ/1", "POS/2", "TQ/2"]
    trial = read_trial(path, position="POS/2", torque="TQ/2")
    np.testing.assert_allclose(trial.torque, TORQUE, atol=1e-6)


def test_channels_of_one_name(tmp_path):
    with pytest.raises(DataError, match=r"S1.flb: 2 variables are called 'POS': give each a name"):
        read_trial(
            write(tmp_path / "S1.flb", flb_case(names=("POS", "POS"))),
            position="POS",
            torque="POS2",
        )


def test_a_case_of_another_container(tmp_path):
    (tmp_path / "a.csv").write_text("position,torque\n0,0\n")
    with pytest.raises(
        DataError, match=r"a.csv: case chooses a trial of an .flb file: leave it out"
    ):
        read_trial(tmp_path / "a.csv", case=1)
