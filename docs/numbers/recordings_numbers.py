"""Numbers of docs/recordings.md: the test for closed loop, and the three published recordings."""

import numpy as np
import pandas as pd
from blocks import block
from runs import EXAMPLE, RESULTS, make, markdown_table, recordings_folder

from ankleloop import segment
from ankleloop.joint.prepared import prepare
from ankleloop.recordings.checks import check_trial
from ankleloop.recordings.path_correlation import stiffness_beside_reflex
from ankleloop.simulation.simulate import simulate_trials


@block("recordings-unseen", ("ankleloop.recordings.recommendation", "ankleloop.records.readers", EXAMPLE))
def write_unseen():
    recordings_folder()
    make("results/tables/recordings.csv", arguments=("--configfile", EXAMPLE))
    table = pd.read_csv(RESULTS / "tables" / "recordings.csv")
    names = list(dict.fromkeys(table["recording"]))
    rows = []
    for label, part in table.groupby("label", sort=False):
        values = part.set_index("recording")["vaf_unseen"]
        rows.append([label, *(f"{values[name]:.1f}" if name in values else "–" for name in names)])
    table = table[table["valid"].eq(True)]
    recommended = table[table["recommended"].eq(True)].set_index("recording")["label"]
    choices = "; ".join(f"{name}: {recommended.get(name, 'none')}" for name in names)
    white, unrelated = table["residual_white"].eq(True).sum(), table["residual_related"].eq(False).sum()
    note = (
        f"Recommended, if the loop was open: {choices}. Of {len(table)} residuals {white} are white in the pass band, "
        f"and {unrelated} show no dependence on the movement."
    )
    return "\n\n".join([markdown_table(["net VAF of the second half [%]", *names], rows), note])


TRIALS = 20
DURATIONS = (6.0, 12.0, 24.0, 60.0)  # s
LOAD = np.array([1.1, 7.1, 250.0])  # kg·m², N·m·s/rad, N·m/rad
SHAKING = 0.1  # of the reference's standard deviation


@block("recordings-loop-test", ("ankleloop.recordings.checks", "ankleloop.simulation.simulate"))
def write_loop_test():
    """Outcomes over load, voluntary torque and duration, and the bias of K that there is."""
    rows = []
    for voluntary in (0.05, 1.0):
        opened = _simulate(voluntary, closed_loop=False)
        for stiffer in (None, 1, 30, 1000):
            trials = opened if stiffer is None else _simulate(voluntary, load=stiffer * LOAD)
            biases = [_stiffness(closed) / _stiffness(other) - 1 for closed, other in zip(trials, opened, strict=True)]
            name = "open loop" if stiffer is None else f"{stiffer:g} × the assumed load"
            bias = "–" if stiffer is None else f"{100 * np.mean(biases):+.1f} %"
            rows.append([name, f"{100 * voluntary:g} %", "–", bias, *_outcomes(trials)])
            if stiffer in (None, 30):
                shaken = [_shake(trial, seed) for seed, trial in enumerate(trials)]
                rows.append([name, f"{100 * voluntary:g} %", f"{100 * SHAKING:g} %", bias, *_outcomes(shaken)])
    header = ["loop", "voluntary torque", "servo off its command by", "bias of K by least squares"]
    table = markdown_table([*header, *(f"{duration:g} s" for duration in DURATIONS)], rows)
    note = (
        f"Outcomes of {TRIALS} simulated trials each (10 dB, reflex gain 13): closed / open / undecided. The bias of K "
        "is that of the same seeds in closed less open loop, by least squares with the reflex as a finite response. "
        "Trials below 10 s are refused alone; of six trials of 6 s each that are merged, the loop is "
    )
    merged = {
        name: check_trial([segment(trial, 0.0, 6.0) for trial in trials[:6]]).loop
        for name, trials in (("closed", _simulate(0.05, load=LOAD)), ("open", _simulate(0.05, closed_loop=False)))
    }
    loops = " and ".join(f"{outcome} where it is {name}" for name, outcome in merged.items())
    return f"{table}\n\n{note}{loops}."


def _simulate(voluntary, **settings):
    return list(simulate_trials(range(TRIALS), duration=DURATIONS[-1], voluntary=voluntary, **settings))


def _shake(trial, seed):
    """The reference without a part of the command, below 8 Hz: a servo that does not follow it."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(trial.sizes["time"]))
    spectrum[np.fft.rfftfreq(trial.sizes["time"], 1e-3) > 8.0] = 0.0
    movement = np.fft.irfft(spectrum, trial.sizes["time"])
    size = SHAKING * float(trial["reference"].std()) / movement.std()
    return trial.assign(reference=trial["reference"] + size * movement)


def _stiffness(trial):
    options = {"delay": 0.04, "basis": "rectifier", "identification_rate": 100.0}
    return stiffness_beside_reflex([prepare(trial).regressors(**options)])


def _outcomes(trials):
    """How many trials of each duration are closed, open and undecided."""
    cells = []
    for duration in DURATIONS:
        loops = [check_trial(segment(trial, 0.0, duration)).loop for trial in trials]
        cells.append(" / ".join(str(loops.count(outcome)) for outcome in ("closed", "open", "undecided")))
    return cells
