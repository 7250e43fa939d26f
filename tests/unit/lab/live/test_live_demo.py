"""The demonstration over the Lab Streaming Layer, in two processes."""

import re
import signal
import subprocess
import sys
from functools import partial

import pandas as pd
import pytest

from ankleloop import read_trial

WATCH = ["live", "--lsl", "ankleloop-demo", "--no-page", "--record", "record.csv"]


def start(folder, *words):
    command = [sys.executable, "-u", "-m", "ankleloop", *words]
    # A shell starts programs in the background with Ctrl+C ignored, and the tests may be one of them.
    hear = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True, preexec_fn=hear)


@pytest.mark.posix
def test_the_demo_is_watched_until_it_is_interrupted(lsl, tmp_path):
    with start(tmp_path, "demo", "--lsl") as demo, start(tmp_path, *WATCH) as live:
        next((line for line in live.stdout if re.match(r" +1\d\.\d s  K \d", line)), None)
        live.send_signal(signal.SIGINT)
        try:
            live.wait(timeout=60)
        finally:
            live.kill()
            demo.kill()
    assert live.returncode == 0
    last = pd.read_csv(tmp_path / "history.csv").iloc[-1]
    assert last["K_low"] < 150.0 < last["K_high"]
    assert read_trial(tmp_path / "record.csv").sizes["time"] >= 10_000
