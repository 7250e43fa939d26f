"""FLB files: every version and format, several cases, and what is damaged."""

import numpy as np
import pytest
from bad_inputs.flb_files import POSITION, RATE, TORQUE, flb_case

from ankleloop import DataError, read_trial
from ankleloop.trials.flb_files import FlbContents


def write(path, *cases):
    path.write_bytes(b"".join(cases))
    return path


@pytest.mark.parametrize("version", [2, 3, 4])
@pytest.mark.parametrize("kind", [2, -2, 4])
def test_every_version_and_format(tmp_path, version, kind):
    path, unit = write(tmp_path / "S1.flb", flb_case(version, kind)), "deg" if kind == 2 else "rad"
    trial = read_trial(path, position="POS", torque="TQ", position_unit=unit, position_sign=-1)
    scale, step = (1000.0, 0.51) if kind == 2 else (1.0, 1.3e-4 if kind == -2 else 1e-6)
    np.testing.assert_allclose(trial.torque, scale * TORQUE, atol=step)
    position = np.deg2rad(1000 * POSITION) if kind == 2 else POSITION
    np.testing.assert_allclose(-trial.position, position, atol=0.0088 if kind == 2 else 2e-6)
    assert trial.attrs["sampling_rate"] == RATE  # 0.001 s is rounded in the file


def test_cases_count_from_1(tmp_path):
    path = write(
        tmp_path / "S1.flb",
        flb_case(comment="relaxed"),
        flb_case(2, -2, scale=0.5),
        flb_case(names=("", "\xb5V")),
    )
    second = read_trial(path, case=2, position="POS", torque="TQ")
    np.testing.assert_allclose(second.torque, 0.5 * TORQUE, atol=2e-4)
    assert second.attrs["case"] == 2
    assert FlbContents(path, 3).names() == ["channel 1", "\xb5V"]
    cases = r"case 1: POS, TQ, 0.4 s at 1000 Hz, 'relaxed'; case 2: POS, TQ, 0.4 s"
    with pytest.raises(
        DataError, match=rf"S1.flb: there are 3 cases: choose one by the option case. {cases}"
    ):
        read_trial(path)
    with pytest.raises(DataError, match="there is no case 4: the file has 3, counted from 1"):
        read_trial(path, case=4)
    np.testing.assert_allclose(read_trial(path, case=1).torque, TORQUE, atol=1e-6)  # by their names


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
