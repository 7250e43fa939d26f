"""C3D and TDMS files: channels with their units, at the rate of the file."""

import numpy as np
import pytest

from ankleloop.errors import DataError
from ankleloop_lab.files.reading import read_trial
from ankleloop_lab.files.reading_process import process

RATE = 500.0
P = 0.02 * np.sin(np.arange(300) / 10)
TQ = 3.0 * np.cos(np.arange(300) / 10)
CHANNELS = {"angle": ("deg", np.degrees(P)), "torque": ("Nm", TQ)}


def write_c3d(path, rate=RATE):
    ezc3d = pytest.importorskip("ezc3d")
    file = ezc3d.c3d()
    values = {"LABELS": list(CHANNELS), "UNITS": [unit for unit, _ in CHANNELS.values()]}
    for name, value in {**values, "RATE": [rate]}.items():
        file["parameters"]["ANALOG"][name]["value"] = value
    file["parameters"]["POINT"]["RATE"]["value"] = [rate / 5]
    file["data"]["points"] = np.zeros((4, 0, 60))
    file["data"]["analogs"] = np.stack([samples for _, samples in CHANNELS.values()])[None]
    file.write(str(path))


def write_tdms(path, *intervals):
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("run", name, samples, {"unit_string": unit, "wf_increment": interval})
        for (name, (unit, samples)), interval in zip(
            CHANNELS.items(), intervals or [1.0 / RATE] * 2, strict=True
        )
    ]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(channels)


@pytest.mark.parametrize(
    ("write", "name"), [(write_c3d, "a.c3d"), (write_tdms, "a.tdms")], ids=["c3d", "tdms"]
)
def test_channels_units_and_rate(tmp_path, write, name):
    write(tmp_path / name)
    trial = read_trial(tmp_path / name)
    np.testing.assert_allclose(trial["position"], P, atol=1e-8)
    np.testing.assert_allclose(trial["torque"], TQ, atol=1e-6)
    assert trial.attrs["sampling_rate"] == RATE
    content = (tmp_path / name).read_bytes()
    for part in (0.3, 0.5, 0.9):
        (tmp_path / name).write_bytes(content[: round(part * len(content))])
        with pytest.raises(DataError, match=rf"^{name}: not a readable .* it is damaged"):
            read_trial(tmp_path / name)


def test_channels_of_two_rates(tmp_path):
    write_tdms(tmp_path / "a.tdms", 0.002, 0.001)
    with pytest.raises(DataError, match=r"a.tdms: there is no sampling rate") as e:
        read_trial(tmp_path / "a.tdms")
    assert e.value.remedy == {"sampling_rate": None}


def test_a_library_that_is_not_there(tmp_path, monkeypatch):
    (tmp_path / "a.c3d").write_bytes(b"x")
    program = f"import sys; sys.modules['ezc3d'] = None; {process.program}"
    monkeypatch.setattr(process, "program", program)
    process.stop()
    with pytest.raises(DataError, match=r"a.c3d: .*ezc3d.*: install what reads such files by: pip"):
        read_trial(tmp_path / "a.c3d")
    process.stop()
