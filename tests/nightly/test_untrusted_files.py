"""Reading of files that are not to be trusted: the tests that take long."""

import gzip
import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import scipy.io

from ankleloop import DataError, read_trial


def test_a_bomb_of_gzip_is_refused(tmp_path):
    with gzip.open(tmp_path / "a.csv.gz", "wb", compresslevel=9) as file:
        file.write(b"time,position,torque\n")
        for _ in range(50):
            file.write(b"0,0,0\n" * 500_000)
    with pytest.raises(DataError, match=r"a.csv.gz: .*(it needs more than|stopped after 10 s)"):
        read_trial(tmp_path / "a.csv.gz")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_fork_of_the_program_takes_a_process_of_its_own(tmp_path):
    good = tmp_path / "a.mat"
    scipy.io.savemat(
        good, {"position": np.sin(0.01 * np.arange(300)), "torque": np.arange(300.0), "fs": 500.0}
    )
    script = f"""
        import os, sys
        import ankleloop
        def read(): return float(ankleloop.read_trial({str(good)!r})["torque"].values.sum())
        expected = read()
        children = []
        for _ in range(3):
            child = os.fork()
            if child == 0:
                os._exit(not all(read() == expected for _ in range(5)))
            children.append(child)
        equal = all(read() == expected for _ in range(5))
        statuses = [os.waitpid(child, 0)[1] for child in children]
        sys.exit(statuses != [0, 0, 0] or not equal)
    """
    assert (
        subprocess.run([sys.executable, "-c", textwrap.dedent(script)], timeout=60).returncode == 0
    )
