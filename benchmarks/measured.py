"""Write the measured numbers of the documentation, docs/measured/*.md, each with its commit and date.

Run by `make benchmark`; the arguments are names of pages (all by default).
"""

import os
import subprocess
import sys
import time
from datetime import UTC, datetime
from statistics import median

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)

import apparatus
import effects
import ensembles
import faults
import interval_coverage
import numpy as np
import peers
import scaling
import time_varying
import verdicts
from scipy import signal
from tools import ROOT, format_table

from ankleloop import cramer_rao, identify, simulate
from ankleloop.methods.registry import JOINT_METHODS
from ankleloop.subspace import moesp

ENSEMBLES = 200  # of each kind
TRIALS = 300  # of each setting, for the intervals and errors of riv


def measure_speed():
    """Processor time of identifications and of a simulation, and the comparison with other programs."""
    trials = [simulate(seed=seed) for seed in range(12)]
    calls = {name: lambda seed, name=name: identify(trials[seed], name) for name in JOINT_METHODS}
    calls["simulate"] = lambda seed: simulate(seed=seed)
    rows = []
    for name, call in calls.items():
        times = []
        for seed in range(len(trials)):
            start = time.process_time()
            call(seed)
            times.append(time.process_time() - start)
        rows.append(
            {"method": f"`{name}`", "trial of 50 s at 1 kHz [ms]": f"{1e3 * median(times[2:]):.0f}"}
        )
    return {
        "One identification": "Median time of the processor on one thread, checks of the data included, without those "
        f"of the first call.\n\n{format_table(rows)}",
        "Other programs": "All steps (A, B, C, D and initial state) in the same rounds, on one thread; the column "
        f"*over ankleloop* has the median of the ratios of the same round.\n\n{peers.compare_all()}",
    }


def measure_scaling():
    """Dry runs of large studies, one and two cores."""
    return {
        "The list of jobs": f"Dry runs, time of the processor.\n\n{format_table(scaling.measure_dry_runs(1000))}",
        "Cores": "A sweep over two settings and an option, by two methods, with the start of Snakemake and of all "
        f"jobs.\n\n{format_table(scaling.scale_cores(1000))}",
    }


def measure_forms():
    """Root mean square error of the poles by each form of the projection, in a linear loop."""
    pole = np.roots([1.0, -1.5, 0.7]).max()
    forms = {
        "ordinary": ("ordinary", 0),
        "correlation": ("correlation", 0),
        "correlation, leads": ("correlation", 6),
    }
    errors = {name: [] for name in forms}
    for seed in range(10):
        rng = np.random.default_rng(seed)
        r = np.repeat(rng.choice([-1.0, 1.0], 4000), 10)
        noise = signal.lfilter([1.0, 0.9], [1.0, -0.95], 0.5 * rng.standard_normal(r.size))
        numerator, denominator = np.array([0.0, 1.0, 0.5]), np.array([1.0, -1.5, 0.7])
        closed = denominator + 0.25 * numerator
        y = signal.lfilter(numerator, closed, r) + signal.lfilter(denominator, closed, noise)
        for name, (form, leads) in forms.items():
            rows = {"instrument_rows": 24 - leads, "instrument_leads": leads}
            model = moesp(r - 0.25 * y, y, 6, 2, "past-reference", form, r, **rows).model
            errors[name].append(abs(max(model.poles(), key=lambda value: value.imag) - pole))
    return [
        {"form": name, "error of the poles": f"{np.sqrt(np.mean(np.square(values))):.3f}"}
        for name, values in errors.items()
    ]


def measure_accuracy():
    """Errors of riv and riv-tv beside the bound, and of the forms of the projection."""
    points = interval_coverage.read_points()
    truths, rows = interval_coverage.read_truths(points), []
    for name, part in interval_coverage.estimate_points(points, TRIALS).groupby(
        "point", sort=False
    ):
        row, bound = {"setting": name}, cramer_rao(seed=1, **points[name])
        for key, truth in truths[name].items():
            error = part[key] - truth
            ratio = np.sqrt(np.mean(error**2)) / bound[key]
            row[key] = (
                f"{100 * error.mean() / truth:+.1f} ± {100 * error.std() / truth:.1f} ({ratio:.2f})"
            )
        rows.append(row)
    return {
        "Constant joints": f"`riv`, {TRIALS} trials of 50 s at 10 dB in each setting of the study `efficiency`: mean "
        "error ± standard deviation [%], and in brackets the root mean square error over the Cramér-Rao bound.\n\n"
        + format_table(rows),
        "Joints that change in time": "20 trials each; root mean square error over the trajectory, over the mean of "
        "the truth, and the share of places at which the 95 % band holds it.\n\n"
        + format_table(time_varying.measure_errors(20)),
        "Forms of the projection": "One input, poles 0.75 ± 0.37j, coloured noise, 40,000 samples, 10 records; past "
        f"reference, with leads past and future.\n\n{format_table(measure_forms())}",
    }


def describe_intervals(target, points, truths):
    """Share of intervals that hold what they are for, as text and table."""
    table = interval_coverage.compute_coverage(
        interval_coverage.estimate_points(points, TRIALS), truths
    )
    rows = table.map("{:.1f}".format).rename_axis("point").reset_index()
    return (
        f"Share of the 95 % intervals of `riv`, the delay being known, that hold {target}. {TRIALS} trials of 50 s in "
        f"each setting; the last column is the share of robust intervals. All in %.\n\n{format_table(rows)}"
    )


def measure_coverage():
    """How often the intervals of riv hold what they are for."""
    points, incomplete = interval_coverage.read_points(), interval_coverage.INCOMPLETE
    truths, limits = (
        interval_coverage.read_truths(points),
        interval_coverage.estimate_truths(incomplete),
    )
    long = "what the same fit gives on a record 100 times as long"
    return {
        "Complete models": describe_intervals("the truth", points, truths),
        "Incomplete models": describe_intervals(long, incomplete, limits),
    }


def measure_faults():
    """Faults of a laboratory that go unseen, and warnings without a fault."""
    cells, false = faults.measure_faults(range(61_000, 61_024), 400)
    counts = ", ".join(f"{name} {count}" for name, count in false.items())
    return {
        "Faults": "24 records of 50 s for each fault: warned / held / wrong without a warning, by more than 15 % of K, "
        "B, I or G, or by three half-widths of its interval. PR-MOESP has a rectifier.\n\n"
        + format_table(cells.reset_index()),
        "Warnings without a fault": "Of 400 records (two loads, five levels of noise, both loops) these methods warned "
        f"although every parameter was within 15 %: {counts}.",
        "Effects of a joint and a recorder": "A simulator that shares no code with `simulate`; 24 records of 50 s for "
        "each size, two loads, voluntary torque of 5 and 50 %: warned / right / silently wrong / warned for nothing. "
        "Wrong is an error of more than 15 % of K, B or G; the last columns are medians of errors by riv [%].\n\n"
        + effects.measure_effects(),
        "Refused, warned, remarked": verdicts.DESCRIPTION
        + verdicts.summarise(verdicts.judge_cases()),
        "Good records": "Kinds of commands, 12 to 300 s, 200 Hz to 10 kHz, with noise and without.\n\n"
        + effects.measure_effects([effects.GOOD], seeds=400),
    }


def measure_ensembles():
    """Short windows around perturbations: `ensemble` beside least squares of the means, and `riv`."""
    columns = [(name, name) for name in ("converged", *ensembles.MEASURED)]
    columns += [("median of G", "median of G"), ("score of G", "score"), ("warned", "warned")]
    columns += [("time [s]", "seconds")]
    squares = [("least squares, 100 ms: K (held) / B", "LS 0.1"), ("60 ms", "LS 0.06")]
    faults_columns = [("converged", "converged"), ("refused", "refused"), ("warned", "warned")]
    faults_columns += [("incomplete", "incomplete"), ("passive", "passive")]
    faults_columns += [(name, name) for name in ensembles.NAMES]
    return {
        "Ensembles": f"{ENSEMBLES} of each kind, from a simulator that shares nothing with `simulate`: a ramp of 0.05 "
        "rad in 60 ms in 40 trials of 140, voluntary torque below 2 Hz of 0.5 to 3 N·m, an offset of 1 N·m between "
        "trials, noise of 0.5 N·m and 0.1 mrad; in the name load, voluntary torque [N·m] and perturbed/nominal trials. "
        "Mean error ± standard deviation [%] of those that converge, and the share of their 95 % intervals that hold "
        "the truth; processor time of a fit with its tests. Beside it least squares of the difference of the means, "
        "with the usual interval of K.\n\n"
        + ensembles.format_summaries(
            ensembles.measure_rows(ensembles.ROWS, ENSEMBLES, 300_000), columns + squares
        ),
        "What the model lacks": "30 ensembles each, load light; incomplete is the share with p ≤ 0.01 for differences "
        "between the conditions that the model does not have.\n\n"
        + ensembles.format_summaries(
            ensembles.measure_rows(ensembles.FAULTS, 30, 600_000), faults_columns
        ),
        "Numbers of trials": "Median half width of the 95 % intervals, voluntary torque of 1.5 N·m, 20 ensembles "
        f"each.\n\n{format_table(ensembles.measure_widths(20))}",
        "Whole records": "300 s, a ramp or none every 1.5 to 3 s, half of each; 6 records of each kind. "
        f"Errors [%].\n\n{format_table(ensembles.measure_records(6))}",
    }


PAGES = {
    "speed": ("Measured: speed", measure_speed),
    "scaling": ("Measured: scaling", measure_scaling),
    "accuracy": ("Measured: accuracy", measure_accuracy),
    "coverage": ("Measured: coverage of intervals", measure_coverage),
    "ensembles": ("Measured: short windows around perturbations", measure_ensembles),
    "faults": ("Measured: faults of a laboratory", measure_faults),
    "apparatus": ("Measured: the apparatus", apparatus.measure_apparatus),
}


def write_page(name):
    """Measure the numbers of a page and write it."""
    title, measure = PAGES[name]
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    ).stdout
    stamp = f"Written by `make benchmark` on {datetime.now(UTC):%Y-%m-%d}, commit {commit.strip()}."
    sections = [f"## {heading}\n\n{text.strip()}" for heading, text in measure().items()]
    text = "\n\n".join([f"# {title}", f"{stamp} Times depend on the machine.", *sections])
    (ROOT / "docs" / "measured" / f"{name}.md").write_text(f"{text}\n", encoding="utf-8")


def main():
    """Write the pages that are named, or all."""
    for name in sys.argv[1:] or PAGES:
        print(f"{name} …", flush=True)
        write_page(name)


if __name__ == "__main__":
    main()
