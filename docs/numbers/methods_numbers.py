"""Numbers of docs/methods.md: forms of the projection, compression, passes of the parallel cascade, errors of riv."""

import numpy as np
import pandas as pd
from blocks import block
from runs import EXAMPLE, RESULTS, make, markdown_table, mean, read_recordings, read_study
from scipy import signal

from ankleloop import identify, simulate
from ankleloop.assessment.bootstrap import block_bootstrap
from ankleloop.assessment.cramer_rao import cramer_rao
from ankleloop.assessment.scores import evaluate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.registry import method_options
from ankleloop.replication.captions import format_point
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.subspace import moesp
from ankleloop.subspace.hankel import block_hankel

SIMULATION, RIV, MOESP = "ankleloop.simulation.simulate", "ankleloop.methods.riv", "ankleloop.methods.moesp"
POLE = np.roots([1.0, -1.5, 0.7]).max()


def simulate_loop(seed, samples=40_000, feedback=0.25):
    """Input, output and reference of a loop with one input, poles 0.75 ± 0.37j and strongly coloured noise."""
    rng = np.random.default_rng(seed)
    r = np.repeat(rng.choice([-1.0, 1.0], samples // 10), 10)
    noise = signal.lfilter([1.0, 0.9], [1.0, -0.95], 0.5 * rng.standard_normal(samples))
    numerator, denominator = np.array([0.0, 1.0, 0.5]), np.array([1.0, -1.5, 0.7])
    closed = denominator + feedback * numerator
    y = signal.lfilter(numerator, closed, r) + signal.lfilter(denominator, closed, noise)
    return r - feedback * y, y, r


@block("projection-forms", ("ankleloop.subspace.moesp",))
def write_projection_forms():
    forms = {
        "ordinary, past reference": ("ordinary", 0),
        "correlation, past reference": ("correlation", 0),
        "correlation, past and future reference": ("correlation", 6),
    }
    rows = []
    for name, (form, leads) in forms.items():
        errors = []
        for seed in range(10):
            u, y, r = simulate_loop(seed)
            model = moesp(
                u, y, 6, 2, "past-reference", form, r, instrument_rows=24 - leads, instrument_leads=leads
            ).model
            errors.append(abs(max(model.poles(), key=lambda pole: pole.imag) - POLE))
        rows.append([name, f"{np.sqrt(np.mean(np.square(errors))):.3f}"])
    return markdown_table(["form", "rms error of the poles"], rows)


@block("projection-joint", (SIMULATION, MOESP), studies=("projection",))
def write_projection_joint():
    table = read_study("projection")
    part = table[table["voluntary"] == 0.05]
    rows = [
        [
            f"`{method}`",
            mean(rows["spectral_radius"], ".2f"),
            mean(rows["K"], ".1f"),
            mean(rows["vaf_reflex_true"], ".1f"),
        ]
        for method, rows in part.groupby("method", sort=False)
    ]
    return markdown_table(["form (study `projection`)", "largest pole", "K [N·m/rad]", "reflex VAF [%]"], rows)


@block("compression-agreement", (SIMULATION, MOESP))
def write_compression_agreement():
    largest, count = 0.0, 0
    for duration in (20.0, 50.0):
        for noise in ({}, {"snr_db": None, "voluntary": 0.0}):
            for basis in ("chebyshev", "rectifier"):
                inputs, torque, r = _regressors(simulate(seed=1, duration=duration, **noise), basis)
                torques = []
                for compression in ("gram", "qr"):
                    estimate = moesp(
                        inputs, torque, 15, 2, "past-reference", "ordinary", r,
                        dynamic=np.arange(inputs.shape[1]) >= 3, rank_tolerance=1e-5, compression=compression,
                    )  # fmt: skip
                    torques.append(np.concatenate([estimate.model.D.ravel(), estimate.model.poles()]))
                largest = max(largest, float(np.max(np.abs(torques[0] - torques[1]) / np.abs(torques[1]))))
                count += 1
    return (
        "With the inputs of the paper the two routes differ in the entries of D and in the poles by at most "
        f"{largest:.0e} of their size ({count} trials in closed loop, of 20 and 50 s, with and without noise, with "
        "both bases)."
    )


def _regressors(trial, basis):
    regressors = prepare(trial).regressors(
        delay=0.04, basis=basis, degree=5, identification_rate=100.0, reference="reference"
    )
    return regressors.inputs, regressors.torque, regressors.reference


@block("cascade-passes", ("ankleloop.methods.parallel_cascade", "ankleloop.records.readers", EXAMPLE))
def write_cascade_passes():
    trial = prepare(read_recordings()["z_pf"])
    rows = {"intrinsic": [], "net": []}
    passes = range(1, 9)
    for number in passes:
        estimate = identify(trial, "parallel-cascade", max_passes=number, tolerance=0.0)
        vaf = evaluate(trial, estimate, against="measured").set_index("torque")["vaf"]
        for torque, values in rows.items():
            values.append(f"{vaf[torque]:.1f}")
    table = [[f"{torque} VAF [%]", *values] for torque, values in rows.items()]
    return markdown_table(["passes (z_pf)", *map(str, passes)], table)


def _efficiency():
    """Table of the study efficiency: a row for each point, method and parameter."""
    make("results/tables/efficiency.csv")
    return pd.read_csv(RESULTS / "tables" / "efficiency.csv")


def _describe_point(point):
    settings = dict(part.split("=") for part in point.split(","))
    return format_point({**SimulationSettings.defaults(), **{name: float(value) for name, value in settings.items()}})


@block("riv-errors", (SIMULATION, RIV, "ankleloop.assessment.cramer_rao"), studies=("efficiency",))
def write_riv_errors():
    table, trials = _efficiency(), read_study("efficiency")
    names = ["K", "B", "I", "G", "omega_n", "zeta"]
    riv = table[(table["method"] == "riv") & table["parameter"].isin(names)]
    rows = []
    for point, part in riv.groupby("point", sort=False):
        values = part.set_index("parameter")
        cells = [
            f"{values['mean'][name]:.4g} ({values['sd'][name]:.2g}; {values['ratio'][name]:.2f})" for name in names
        ]
        vaf = trials[(trials["point"] == point) & (trials["method"] == "riv")]
        parts = " / ".join(f"{vaf[f'vaf_{torque}_true'].mean():.2f}" for torque in ("intrinsic", "reflex"))
        rows.append([_describe_point(point), *cells, parts])
    header = ["setting", "K [N·m/rad]", "B [N·m·s/rad]", "I [kg·m²]", "G [N·m·s/rad]", "ωn [rad/s]", "ζ"]
    main = riv[riv["parameter"].isin(["K", "B", "I", "G"])]
    return (
        f"{markdown_table([*header, 'intrinsic / reflex VAF [%]'], rows)}\n\n"
        f"Means of {riv['n'].max()} trials; in brackets the standard deviation over trials, and the root mean square "
        f"error over the Cramér-Rao bound. That ratio is {main['ratio'].min():.2f} to {main['ratio'].max():.2f} for K, "
        f"B, I and G, and at most {riv['ratio'].max():.2f} for all six."
    )


@block("riv-others", (SIMULATION, RIV, MOESP, "ankleloop.methods.parallel_cascade"), studies=("efficiency",))
def write_other_methods():
    table = _efficiency()
    stiffness = table[table["parameter"] == "K"]
    rows = []
    for method, part in stiffness.groupby("method", sort=False):
        errors, ratios = 100 * part["bias"] / part["truth"], part["ratio"]
        extents = f"{errors.min():+.1f} … {errors.max():+.1f}", f"{ratios.min():.2f} … {ratios.max():.2f}"
        rows.append([f"`{method}`", *extents])
    return markdown_table(["method (study `efficiency`)", "mean error of K [%]", "rms error of K over the bound"], rows)


@block("riv-delay", (SIMULATION, RIV), studies=("efficiency",))
def write_delay():
    table = _efficiency()
    part = table[(table["method"] == "riv-delay") & (table["parameter"] == "delay")]
    texts = [f"{1e3 * row.sd:.1f} ms ({_describe_point(row.point)})" for row in part.itertuples()]
    return f"With `delay=None` the standard deviation of the delay is {'; '.join(texts)}."


def _singular_values(trial, basis, form, rows=15):
    """Of the matrix whose row space the projection removes, relative to the largest one."""
    regressors = prepare(trial).regressors(delay=0.04, basis=basis, degree=5, identification_rate=100.0)
    signals = np.column_stack([regressors.inputs, regressors.torque])
    signals = (signals - signals.mean(axis=0)) / signals.std(axis=0)
    columns = len(signals) - 2 * rows + 1
    inputs = block_hankel(signals[:, :-1], rows, rows, columns)
    inputs -= inputs.mean(axis=1, keepdims=True)
    if form == "ordinary":
        values = np.linalg.svd(inputs, compute_uv=False)
    else:  # with the instruments of EIV-MOESP
        instruments = block_hankel(signals, 0, rows, columns)
        values = np.linalg.svd(inputs @ (instruments - instruments.mean(axis=1, keepdims=True)).T, compute_uv=False)
    return values / values[0]


@block("rank-gaps", (SIMULATION, MOESP))
def write_rank_gaps():
    tolerance = method_options("pr-moesp")["rank_tolerance"]
    trials = [
        simulate(seed=seed, **settings) for seed in range(4) for settings in ({}, {"snr_db": None, "voluntary": 0.0})
    ]
    rows = []
    for basis in ("chebyshev", "rectifier"):
        for form in ("ordinary", "correlation"):
            parts = [_singular_values(trial, basis, form) for trial in trials]
            ranks = [int(np.sum(values > tolerance)) for values in parts]
            above = min(values[rank - 1] for values, rank in zip(parts, ranks, strict=True))
            below = max(values[rank] for values, rank in zip(parts, ranks, strict=True))
            counts = f"{min(ranks)} to {max(ranks)}" if min(ranks) < max(ranks) else f"{ranks[0]}"
            rows.append([f"`{basis}`", form, f"{counts} of {parts[0].size}", f"{above:.1e}", f"{below:.1e}"])
    header = ["basis", "form", "directions that count", "smallest that counts", "largest that does not"]
    return (
        f"{markdown_table(header, rows)}\n\nSingular values relative to the largest one, of {len(trials)} trials of "
        f"50 s in closed loop, half of them without disturbances; the tolerance is {tolerance:g}."
    )


@block("bootstrap-widths", (SIMULATION, RIV, "ankleloop.assessment.bootstrap"))
def write_bootstrap_widths():
    ratios = []
    for seed in range(4):
        trial = prepare(simulate(seed=seed))
        estimate, bootstrap = identify(trial, "riv"), block_bootstrap(trial, "riv", repetitions=200, seed=seed)
        for name, (low, high) in bootstrap.intervals().items():
            if name in estimate.intervals:
                ratios.append((high - low) / np.subtract(*estimate.intervals[name][::-1]))
    return (
        f"The intervals of the block bootstrap (`block_bootstrap`) are {min(ratios):.2f} to {max(ratios):.2f} times as "
        f"wide (median {np.median(ratios):.2f}; {len(ratios)} intervals of 4 trials, 200 repetitions each)."
    )


@block("bound-loop", ("ankleloop.assessment.cramer_rao",))
def write_bound_of_the_loop():
    texts = []
    for level, gain in ((0.05, 13.0), (1.0, 15.0)):
        settings = {"voluntary": level, "reflex_gain": gain}
        bounds = [
            np.mean([cramer_rao(seed=seed, fed_back=known, **settings)["K"] for seed in range(5)])
            for known in (True, False)
        ]
        texts.append(f"{100 * (bounds[1] / bounds[0] - 1):.1f} % at voluntary {100 * level:g} %")
    return (
        "- the information of a known spectrum about the loop, by which the standard deviation of K grows: "
        f"{', '.join(texts)};"
    )
