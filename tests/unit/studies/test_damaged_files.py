"""Intermediate files that are cut off: the next reader names the file, and says that deleting it mends it."""

import pytest

from ankleloop import DataError
from ankleloop.joint.estimate_files import load_estimates
from ankleloop.paper.results import read_results
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.identification import identify_chunk
from ankleloop.studies.simulation import simulate_chunk
from ankleloop.trials.files import LENGTH
from ankleloop.trials.trial_files import load_trial_of

METHODS = {"pr": {"method": "pr-moesp", "options": {"basis": "rectifier"}}}
NAMES = {
    "trials": "trials.nc",
    "estimates": "estimates.parquet",
    "scores": "scores.csv",
    "parameters": "parameters.csv",
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Every intermediate file of a chunk, as bytes."""
    folder = tmp_path_factory.mktemp("whole")
    settings = SimulationSettings(duration=8.0).model_dump()
    simulate_chunk(folder / NAMES["trials"], "small", 1, {"p": {"settings": settings, "first": 0, "stop": 2}})
    identify(folder)
    return {kind: (folder / name).read_bytes() for kind, name in NAMES.items()}


def identify(folder):
    files = {kind: folder / name for kind, name in NAMES.items() if kind != "trials"}
    points = {"p": {"p": {"values": {}, "options": {}}}}
    identify_chunk(folder / NAMES["trials"], files, "small", points, METHODS)


def read(folder, kind):
    """What reads a file of a kind in the next job."""
    path = folder / NAMES[kind]
    if kind == "trials":
        load_trial_of([path], "p", 1)
        identify(folder)
    elif kind == "estimates":
        assert len(load_estimates([path], "p", "pr")) == 2
    else:
        read_results([path])


@pytest.mark.parametrize("kind", NAMES)
def test_whole_files_are_read(whole, tmp_path, kind):
    (tmp_path / NAMES[kind]).write_bytes(whole[kind])
    read(tmp_path, kind)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, "one byte"])
@pytest.mark.parametrize("kind", NAMES)
def test_a_file_that_is_cut_off_is_named_with_the_remedy(whole, tmp_path, kind, share):
    content, path = whole[kind], tmp_path / NAMES[kind]
    content = content[:-LENGTH] if path.suffix == ".nc" else content  # a file without a checksum, but for one byte
    size = len(content) - 1 if share == "one byte" else int(share * len(content))
    path.write_bytes(content[:size])
    with pytest.raises(DataError, match=rf"{path.name}.*delete it") as caught:
        read(tmp_path, kind)
    assert "\n" not in str(caught.value)
    assert [path.name] == [file.name for file in tmp_path.iterdir()]


@pytest.mark.parametrize("kind", ["scores", "parameters"])
def test_a_table_with_a_row_that_is_cut_off_in_the_middle_is_named(whole, tmp_path, kind):
    lines = whole[kind].splitlines(keepends=True)
    (tmp_path / NAMES[kind]).write_bytes(b"".join([*lines[:-1], lines[-1].rpartition(b",")[0], b"\n"]))
    with pytest.raises(DataError, match=rf"{NAMES[kind]}: the table is damaged \(line \d+ has \d+ of \d+ cells\)"):
        read_results([tmp_path / NAMES[kind]])


def test_a_missing_table_is_named(tmp_path):
    with pytest.raises(DataError, match=r"nowhere\.csv"):
        read_results([tmp_path / "nowhere.csv"])
