"""FLB files: every version and format, several cases, and what is damaged."""

import numpy as np
import pytest

from ankleloop import DataError, LongRecord, read_trial
from ankleloop.trials.reading_process import list_variables

RATE = 1000.0
TIME = np.arange(400) / RATE
POSITION, TORQUE = 0.02 * np.sin(20 * TIME), 3.0 * np.cos(20 * TIME)
LOW, HIGH = np.array([-0.1, -8.0]), np.array([0.1, 8.0])
TYPES = {4: "<f4", 2: "<i2", -2: "<u2"}


def integers(*values):
    return np.array(values, "<i4").tobytes()


def text(value):
    return integers(len(value)) + value.encode("latin-1")


def case(version=4, kind=4, names=("POS", "TQ"), comment="", scale=1.0, realizations=1, interval=1 / RATE):
    """Bytes of a case, written from the description of the format."""
    samples = np.stack([POSITION, TORQUE] * realizations) * scale
    if kind == -2:
        low, high = (np.tile(ends, realizations)[:, None] for ends in (LOW, HIGH))
        samples = np.round((samples - low) / (high - low) * 65535)
    elif kind == 2:
        samples = np.round(1000 * samples)
    content = integers(version) + (b"" if version == 2 else integers(2, realizations))
    content += integers(2, TIME.size, kind) + text("Time") + np.array([interval, 0.0], "<f4").tobytes() + text(comment)
    content += b"".join(map(text, names)) + LOW.tobytes() + HIGH.tobytes()
    return content + samples.astype(TYPES.get(kind, "u1")).tobytes()


def write(path, *cases):
    path.write_bytes(b"".join(cases))
    return path


@pytest.mark.parametrize("version", [2, 3, 4])
@pytest.mark.parametrize("kind", [2, -2, 4])
def test_every_version_and_format(tmp_path, version, kind):
    path, unit = write(tmp_path / "S1.flb", case(version, kind)), "deg" if kind == 2 else "rad"
    trial = read_trial(path, position="POS", torque="TQ", position_unit=unit, position_sign=-1)
    scale, step = (1000.0, 0.51) if kind == 2 else (1.0, 1.3e-4 if kind == -2 else 1e-6)
    np.testing.assert_allclose(trial.torque, scale * TORQUE, atol=step)
    position = np.deg2rad(1000 * POSITION) if kind == 2 else POSITION
    np.testing.assert_allclose(-trial.position, position, atol=0.0088 if kind == 2 else 2e-6)
    assert trial.attrs["sampling_rate"] == RATE  # 0.001 s is rounded in the file


def test_cases_count_from_1(tmp_path):
    path = write(tmp_path / "S1.flb", case(comment="relaxed"), case(2, -2, scale=0.5), case(names=("", "\xb5V")))
    second = read_trial(path, case=2, position="POS", torque="TQ")
    np.testing.assert_allclose(second.torque, 0.5 * TORQUE, atol=2e-4)
    assert second.attrs["case"] == 2
    assert [variable.name for variable in list_variables(path, case=3)] == ["channel 1", "\xb5V"]
    cases = r"case 1: POS, TQ, 0.4 s at 1000 Hz, 'relaxed'; case 2: POS, TQ, 0.4 s"
    with pytest.raises(DataError, match=rf"S1.flb: there are 3 cases: choose one by the option case. {cases}"):
        read_trial(path)
    with pytest.raises(DataError, match="there is no case 4: the file has 3, counted from 1"):
        read_trial(path, case=4)
    np.testing.assert_allclose(read_trial(path, case=1).torque, TORQUE, atol=1e-6)  # by their names


def test_realizations_have_numbers(tmp_path):
    path = write(tmp_path / "S1.flb", case(realizations=2))
    assert [v.name for v in list_variables(path)] == ["POS/1", "TQ/1", "POS/2", "TQ/2"]
    trial = read_trial(path, position="POS/2", torque="TQ/2")
    np.testing.assert_allclose(trial.torque, TORQUE, atol=1e-6)


def test_long_records(tmp_path):
    path = write(tmp_path / "S1.flb", case(), case(kind=-2, scale=0.5))
    record = LongRecord(path, position="POS", torque="TQ", reference=None, case=2)
    assert (record.samples, record.rate) == (TIME.size, RATE)
    np.testing.assert_allclose(record.read(100, 200)["torque"], 0.5 * TORQUE[100:200], atol=2e-4)


WHOLE = case()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (WHOLE[:-1], r"\(case 1 is cut off\): check that the file is whole"),
        (WHOLE + WHOLE[:40], r"\(case 2 is cut off\): check that the file is whole"),
        (b"ab", r"\(it has no case\): check that the file is whole"),
        (case(version=1), r"\(case 1 is of version 1, and there are 2, 3 and 4\): check that its suffix is right"),
        (case(kind=1), r"\(case 1 has samples of format 1, and 4, 2 and -2 are read\): convert it"),
        (case(interval=0.0), r"\(case 1 has no samples, or no sampling interval\): check"),
        (WHOLE[:24] + integers(-5) + WHOLE[28:], r"\(case 1 is cut off\): check that the file is whole"),
    ],
)
def test_damaged_files_are_refused(tmp_path, content, message):
    with pytest.raises(DataError, match=rf"^S1.flb: cannot be read as .flb {message}"):
        read_trial(write(tmp_path / "S1.flb", content))


def test_a_case_of_another_container(tmp_path):
    (tmp_path / "a.csv").write_text("position,torque\n0,0\n")
    with pytest.raises(DataError, match=r"a.csv: case chooses a trial of an .flb file: leave it out"):
        read_trial(tmp_path / "a.csv", case=1)
