"""Streams and tables that grow: what is read of them is what was sent."""

import subprocess
import sys
from itertools import islice

import numpy as np
import pytest

from ankleloop import DataError
from ankleloop_lab.files.reading_options import ReadingOptions
from ankleloop_lab.live import sources
from ankleloop_lab.live.sources import StreamSource, TableSource

COUNT = 3000
SAMPLES = np.arange(3 * COUNT, dtype=float).reshape(COUNT, 3)


def join(pieces):
    """Pieces of samples as one."""
    pieces = list(pieces)
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def read(source, count):
    """The next samples of a source, at least some number of them."""
    samples = next(source)
    while samples["torque"].size < count:
        samples = join([samples, next(source)])
    return samples


def push(outlet, samples, start):
    """Send samples in pieces, at 1 kHz by their stamps."""
    for number, piece in enumerate(np.split(samples, len(samples) // 25), 1):
        outlet.push_chunk(piece, start + 0.025 * number)


def test_a_stream_that_ends_and_begins_again_loses_nothing(lsl, new_outlet):
    outlet = new_outlet("again")
    source = StreamSource("again", ReadingOptions(torque="1", reference="command"))
    pieces = iter(source)
    next(pieces)  # which opens the stream
    push(outlet, SAMPLES[:1000], lsl.local_clock())
    first = read(pieces, 1000)
    del outlet
    outlet = new_outlet("again")
    while not outlet.wait_for_consumers(0.1):
        next(pieces)
    push(outlet, SAMPLES[1000:], lsl.local_clock())
    samples = join([first, read(pieces, 2000)])
    assert source.rate == 1000.0
    np.testing.assert_allclose(samples["position"], np.radians(SAMPLES[:, 0]))
    np.testing.assert_allclose(samples["torque"], SAMPLES[:, 1])
    np.testing.assert_allclose(samples["reference"], np.radians(SAMPLES[:, 2]))
    steps = np.diff(samples["time"])
    assert np.flatnonzero(steps > 1.5e-3).tolist() == [999]  # the time between is a gap


@pytest.mark.parametrize(
    ("mapping", "fault"),
    [
        ({"torque": "fz"}, "there is no variable 'fz'; the file has: angle, torque, command"),
        ({"reference": "none"}, "name the command of the servo"),
        ({"torque_unit": "mN·m"}, "torque is in 'N.m'"),
    ],
)
def test_channels_that_do_not_fit_are_refused(new_outlet, mapping, fault):
    outlet = new_outlet("refused")
    with pytest.raises(DataError, match=fault):
        StreamSource("refused", ReadingOptions(**mapping))
    del outlet


def test_a_name_that_no_stream_or_several_have_is_refused(new_outlet, monkeypatch):
    monkeypatch.setattr(sources, "SEARCH", 1.0)
    outlets = [new_outlet("twin"), new_outlet("twin", source="other")]
    with pytest.raises(DataError, match="2 streams are called 'twin'"):
        StreamSource("twin", ReadingOptions())
    with pytest.raises(DataError, match=r"0 streams are called 'nowhere'.*twin"):
        StreamSource("nowhere", ReadingOptions())
    del outlets


def test_without_the_library_the_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with pytest.raises(DataError, match=r"pip install pylsl.*glibc 2\.35"):
        StreamSource("any", ReadingOptions())


def list_rows(start, stop):
    """Lines of a table, with decimal commas."""
    return [
        f"{row / 100:.2f};{row},5;{2 * row},0;{row},0\n".replace(".", ",")
        for row in range(start, stop)
    ]


def test_a_table_is_followed_while_it_grows_also_within_a_line(tmp_path):
    path = tmp_path / "growing.csv"
    with open(path, "w") as file:
        file.writelines(
            ["Zeit (s);Winkel (deg);Moment (N.m);Soll\n", *list_rows(0, 150), "1,50;15"]
        )
        file.flush()
        source = TableSource(path, ReadingOptions(position="Winkel (deg)", reference="Soll"))
        pieces = iter(source)
        first = join(islice(pieces, 150))
        assert next(pieces)["torque"].size == 0
        file.writelines(["0,5;broken;0\n", *list_rows(151, 200)])
        file.flush()
        samples = join([first, read(pieces, 50)])
    rows = np.arange(200.0)
    assert source.rate == 100.0
    np.testing.assert_allclose(samples["torque"], np.where(rows == 150, np.nan, 2.0 * rows))
    np.testing.assert_allclose(samples["position"], np.radians(rows + 0.5))
    np.testing.assert_allclose(samples["time"], rows / 100.0)


UNTOUCHED = """
import pandas as pd
before = pd.get_option("mode.string_storage")
import ankleloop_lab.live.sources
assert pd.get_option("mode.string_storage") == before
"""


def test_importing_sources_changes_no_option_of_pandas():
    subprocess.run([sys.executable, "-c", UNTOUCHED], check=True)
