"""New damaged files for every reader, other ones each day; FUZZ_MINUTES for each reader (10 seconds by default)."""

import datetime
import os

import pytest
from fuzz import fuzz
from fuzz.corpus import READERS

MINUTES = float(os.environ.get("FUZZ_MINUTES", 1 / 6))
SEED = datetime.date.today().toordinal()


@pytest.mark.parametrize("reader", READERS)
def test_damaged_files_are_read_or_refused(reader, tmp_path):
    counts, failures = fuzz.fuzz_reader(reader, MINUTES, SEED, tmp_path)
    assert failures == {}, f"seed {SEED}"
    assert counts["files"] == counts["read"] + counts["refused"] > 0
