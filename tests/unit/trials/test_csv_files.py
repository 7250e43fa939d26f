"""Tables of text: what is cut off, ambiguous or no table is refused with its line."""

import os
import warnings

import numpy as np
import pytest

from ankleloop.errors import DataError
from ankleloop.trials import csv_files
from ankleloop.trials.csv_files import CsvContents
from ankleloop.trials.readers import read_trial

HEADER = "position,torque,note\n"
ROWS = "".join(f"{0.01 * k:.3f},{k * k:.2f},x\n" for k in range(50))


def table(folder, text, name="a.csv"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return CsvContents(path)


def columns(folder, text, *names):
    contents = table(folder, text)
    return {name: contents.require(name).read(slice(None)) for name in names or ("position", "torque")}


def refused(folder, text, *names):
    with pytest.raises(DataError) as error:
        columns(folder, text, *names)
    return str(error.value)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\n\n\n", "\n  \n"])
@pytest.mark.parametrize("block", [7, 64, 1 << 20])
def test_ends_of_lines(tmp_path, monkeypatch, end, block):
    monkeypatch.setattr(csv_files, "BLOCK", block)
    text = (HEADER + ROWS).replace("\n", end)
    values = columns(tmp_path, text)
    np.testing.assert_array_equal(values["torque"], np.arange(50.0) ** 2)
    np.testing.assert_allclose(values["position"], 0.01 * np.arange(50), atol=1e-12)


@pytest.mark.parametrize("block", [16, 1 << 20])
def test_lines_are_numbered_as_editors_do(tmp_path, monkeypatch, block):
    monkeypatch.setattr(csv_files, "BLOCK", block)
    lines = ["", *(HEADER + ROWS).splitlines()]
    lines.insert(20, "")
    file = table(tmp_path, "\n".join(lines) + "\n")
    assert file.locate_sample(0) == "in line 3"
    assert file.locate_sample(49) == f"in line {len(lines)}"
    lines[30] = "0,1"
    file = table(tmp_path, "\n".join(lines) + "\n")
    with pytest.raises(DataError, match=r"a.csv: line 31 has 2 cells and the header 3: note is missing there"):
        file.load(["note"])


@pytest.mark.parametrize("header", ["position,position \n", '"position", position\n', "position,\tposition\n"])
def test_columns_of_one_name(tmp_path, header):
    message = refused(tmp_path, header + "1,2\n3,4\n", "position")
    assert message == "a.csv: 2 columns are called 'position' (columns 1, 2): give each a name of its own."


def test_a_number_that_is_cut_off_is_refused_and_a_whole_one_of_fixed_digits_is_not(tmp_path):
    text = "position,torque\n" + "".join(f"{0.01 * k:.3f},{k + 0.125:.4f}\n" for k in range(50))
    message = refused(tmp_path, text[:-3])
    assert message.startswith("a.csv: the file ends within line 51, at the torque '49.12', which has fewer digits")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert columns(tmp_path, text[:-1])["torque"][-1] == 49.125


def test_a_number_that_may_be_cut_off_gives_a_warning(tmp_path):
    with pytest.warns(UserWarning, match=r"a.csv: the file ends within line 3, at the torque '34', without an end of"):
        assert columns(tmp_path, "position,torque\n1,2\n3,34")["torque"].tolist() == [2, 34]


@pytest.mark.parametrize("cut", range(1, 40))
def test_wherever_a_file_is_cut_off_no_number_changes_in_silence(tmp_path, cut):
    """Rows before the cut are right; a last row is there only if it is right, or with a warning."""
    text = "position,torque\n" + "".join(f"{0.01 * k:.4f},{k + 0.0625:.4f}\n" for k in range(30))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            values = columns(tmp_path, text[:-cut])
        except (DataError, UserWarning):
            return
    count = values["torque"].size
    np.testing.assert_array_equal(values["torque"], np.arange(count) + 0.0625)
    np.testing.assert_allclose(values["position"], 0.01 * np.arange(count), atol=1e-12)


# --- paths


def test_a_file_without_permission(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(HEADER + ROWS)
    path.chmod(0)
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(65534)  # root may read everything
    try:
        with pytest.raises(DataError, match=r"a.csv: the file cannot be opened \(Permission denied\): check the path"):
            read_trial(path)
    finally:
        if is_root:
            os.seteuid(0)
