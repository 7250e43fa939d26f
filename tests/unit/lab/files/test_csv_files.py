"""Tables of text: what is cut off, ambiguous or no table is refused with its line."""

import os

import numpy as np
import pytest

from ankleloop.errors import DataError
from ankleloop_lab.files.csv_files import CsvContents
from ankleloop_lab.files.reading import read_trial

HEADER = "position,torque,note\n"
ROWS = "".join(f"{0.01 * k:.3f},{k * k:.2f},x\n" for k in range(50))


def columns(folder, text):
    (folder / "a.csv").write_text(text, newline="")
    contents = CsvContents(folder / "a.csv")
    return {name: contents.require(name).read() for name in ("position", "torque")}


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\n\n\n", "\n  \n"])
def test_ends_of_lines(tmp_path, end):
    values = columns(tmp_path, (HEADER + ROWS).replace("\n", end))
    np.testing.assert_array_equal(values["torque"], np.arange(50.0) ** 2)
    np.testing.assert_allclose(values["position"], 0.01 * np.arange(50), atol=1e-12)


def test_a_preamble_between_quotes_loses_no_sample(tmp_path):
    values = columns(tmp_path, f'"recorded by\nsomebody"\n{HEADER}{ROWS}')
    np.testing.assert_array_equal(values["torque"], np.arange(50.0) ** 2)


@pytest.mark.parametrize(
    "below", ["channel 1,channel 2,\n", "deg,Nm,\n", "channel 1,channel 2,\ndeg,Nm,\n"]
)
def test_rows_below_the_names(tmp_path, below):
    values = columns(tmp_path, f"{HEADER}{below}{ROWS}")
    np.testing.assert_array_equal(values["torque"], np.arange(50.0) ** 2)


def test_names_below_the_devices(tmp_path):
    values = columns(tmp_path, f"Plate,Plate torque,Clock\n{HEADER}{ROWS}")
    np.testing.assert_array_equal(values["torque"], np.arange(50.0) ** 2)


def test_commas_at_the_ends_of_lines(tmp_path):
    for header, row in (("position,torque,", "1,2"), ("position,torque", "1,2,,")):
        assert columns(tmp_path, f"{header}\n{row}\n{row}\n")["torque"].tolist() == [2, 2]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b" \n", "no names above numbers with semicolons, tabs, commas or blanks between them"),
        (
            b"my position torque\n1 2\n1 2\n",
            "blanks between the numbers, and more or fewer names in line 1: write semicolons",
        ),
        (b"1\t2\n1\t2\n", "no names above numbers with tabs between them"),
        (b"position,torque\n1,2\n1,\xe4\n", "torque is not a number in line 3 but"),
        (b"position,torque\n1,2\n1,2\0\n", "torque is not a number in line 3 but"),
        (
            "position,torque\n1,2\n".encode("utf-16-le"),
            "(UTF-16 stream|: Stream) does not start with BOM",
        ),
    ],
)
def test_what_is_no_table(tmp_path, content, message):
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(DataError, match=message):
        read_trial(tmp_path / "a.csv", sampling_rate=100.0)


@pytest.mark.parametrize("cut", [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 13, 14, 15, 16, 30])
def test_wherever_a_file_is_cut_off_no_number_changes_in_silence(tmp_path, cut):
    """Rows before the cut are right, and a last row is there only if it is right."""
    text = "position,torque\n" + "".join(f"{0.01 * k:.4f},{k + 0.0625:.4f}\n" for k in range(30))
    try:
        values = columns(tmp_path, text[:-cut])
    except DataError:
        return
    count = values["torque"].size
    assert cut > 1 or count == 30
    np.testing.assert_array_equal(values["torque"], np.arange(count) + 0.0625)


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
