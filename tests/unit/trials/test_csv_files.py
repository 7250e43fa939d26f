"""Tables of text: what is cut off, ambiguous or no table is refused with its line."""

import os

import numpy as np
import pytest

from ankleloop.errors import DataError
from ankleloop.trials.csv_files import CsvContents
from ankleloop.trials.readers import read_trial

HEADER = "position,torque,note\n"
ROWS = "".join(f"{0.01 * k:.3f},{k * k:.2f},x\n" for k in range(50))


def columns(folder, text, *names):
    (folder / "a.csv").write_text(text, newline="")
    contents, names = CsvContents(folder / "a.csv"), names or ("position", "torque")
    return {name: contents.require(name).read() for name in names}


def refused(folder, text, *names):
    with pytest.raises(DataError) as error:
        columns(folder, text, *names)
    return str(error.value)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\n\n\n", "\n  \n"])
def test_ends_of_lines(tmp_path, end):
    values = columns(tmp_path, (HEADER + ROWS).replace("\n", end))
    np.testing.assert_array_equal(values["torque"], np.arange(50.0) ** 2)
    np.testing.assert_allclose(values["position"], 0.01 * np.arange(50), atol=1e-12)


def test_commas_at_the_ends_of_lines(tmp_path):
    for header, row in (("position,torque,", "1,2"), ("position,torque", "1,2,,")):
        assert columns(tmp_path, f"{header}\n{row}\n{row}\n")["torque"].tolist() == [2, 2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "there are no names above numbers with"),
        (
            "position,torque\n1,2\n1,\udce4\n",
            "line 3 is no text in UTF-8 (byte 0xe4): save it as CSV in UTF-8",
        ),
        ("position,torque\n1,2\n".encode("utf-16-le"), "line 1 is no text in UTF-8 (byte 0x00)"),
        ("position,torque\n1,2\0\n", "line 2 is no text in UTF-8 (byte 0x00): save it"),
    ],
)
def test_what_is_no_table(tmp_path, text, message):
    content = text.encode("utf-8", "surrogateescape") if isinstance(text, str) else text
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(DataError) as error:
        CsvContents(tmp_path / "a.csv")
    assert message in str(error.value)


def test_a_number_that_may_be_cut_off_gives_a_warning(tmp_path):
    text = "position,torque\n" + "".join(f"{0.001 * k},{k * k}\n" for k in range(20)).rstrip("\n")
    (tmp_path / "a.csv").write_text(text)
    with pytest.warns(
        UserWarning, match=r"a.csv: the file ends within line 21, at the torque .361., without"
    ) as caught:
        assert read_trial(tmp_path / "a.csv", sampling_rate=100.0).torque[-1] == 361
    assert caught[0].filename == __file__


@pytest.mark.parametrize("cut", [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 13, 14, 15, 16, 30])
def test_wherever_a_file_is_cut_off_no_number_changes_in_silence(tmp_path, cut):
    """Rows before the cut are right; a last row is there only if it is right, or with a warning."""
    text = "position,torque\n" + "".join(f"{0.01 * k:.4f},{k + 0.0625:.4f}\n" for k in range(30))
    (tmp_path / "a.csv").write_text(text[:-cut])
    try:
        contents = CsvContents(tmp_path / "a.csv")
        values = {name: contents.find(name).read() for name in ("position", "torque")}
    except DataError:
        return
    if contents.warnings:
        return
    count = values["torque"].size
    assert cut > 1 or count == 30
    np.testing.assert_array_equal(values["torque"], np.arange(count) + 0.0625)
    np.testing.assert_allclose(values["position"], 0.01 * np.arange(count), atol=1e-12)


@pytest.mark.posix
def test_a_file_without_permission(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(HEADER + ROWS)
    path.chmod(0)
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(65534)  # root may read everything
    try:
        with pytest.raises(
            DataError,
            match=r"a.csv: the file cannot be opened \(Permission denied\): check the path",
        ):
            read_trial(path)
    finally:
        if is_root:
            os.seteuid(0)
