"""How many right estimates are refused, warned of or remarked, and how many wrong ones are not: counts of four sets.

`python benchmarks/verdicts.py` prints them; an argument is the name of a set. An estimate is right where each of K, B,
I and G that it gives is within 15 %; it is silently wrong where one is not, its interval excludes the truth, and there
is no warning (a remark is none).
"""

import argparse
import itertools
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
import pandas as pd
from effects import EFFECTS, GOOD, make_trial
from faults import FAULTS, LOADS, TRUTHS, make_faulty_trial, make_good_trial
from independent import simulate_independently
from scipy import special
from scipy.interpolate import make_interp_spline
from tools import format_table

from ankleloop import DataError, check_trial, identify, new_trial, simulate
from ankleloop.joint.verdicts import TOLERANCE

SETS = ("faults", "good", "rigs", "loud")
DESCRIPTION = (
    "Faults and effects of the other tables; good records; five joints on rigs with a torque 0.05 to 0.5 ms early or "
    "late, filters of second order, 14 bits or 0.3 mrad of noise; subjects who push 0.5 to 2.5 times as hard as the "
    "torque, at 1 to 30 mrad. Estimates by `riv` are right where K, B, I and G are within 15 %, within the tolerance "
    "where they are within 10 %. They are silently wrong where one is not right, its interval excludes the truth and "
    "there is no warning; of those without a warning, intervals of 95 % that hold what they say leave so many by "
    "chance alone. Some kinds are listed as invisible ([reliability](../reliability.md#invisible-with-sizes)).\n\n"
)
SEED = 7_200_000
RIGHT = 0.15
# Kinds that docs/reliability.md lists as invisible, with sizes.
INVISIBLE = (
    "inertia with a footplate",
    "stiffness with gravity",
    "rate taken",
    "interpolation",
    "every fifth sample",
    "series stiffness",
    "short-range stiffness",
    "stiffness that relaxes",
    "low-pass filters",
    "clock",
    "drift of the",
    "jitter",
)
NARROW = 0.15  # half-width of an interval over its value
# K, B, I and G of joints, from a finger to a knee.
JOINTS = {
    "finger": (4.0, 0.02, 2e-4, 0.2),
    "wrist": (10.0, 0.1, 3e-3, 0.6),
    "elbow": (40.0, 1.0, 0.06, 2.0),
    "ankle": (150.0, 0.8, 0.015, 13.0),
    "knee": (250.0, 4.0, 0.35, 12.0),
}
# Inertia, viscosity and stiffness of a load over those of the joint: a heavy one and a light one.
LOAD_RATIOS = ((70.0, 9.0, 1.7), (7.0, 12.0, 0.7))
RIGS = {
    "torque early": {},
    "torque late": {},
    "filter of second order": {"order": 2},
    "quantisation": {},
    "noise of the position": {},
}


def shift_torque(trial, seconds):
    """A trial whose torque is recorded later."""
    time = trial.time.to_numpy()
    torque = make_interp_spline(time, trial.torque.to_numpy(), k=5)(
        np.clip(time - seconds, time[0], time[-1])
    )
    return trial.assign(torque=("time", torque))


def make_rig_trial(joint, rig, seed):
    """A trial of a joint on a rig with a small imperfection, and its true parameters."""
    rng = np.random.default_rng(seed)
    stiffness, viscosity, inertia, gain = JOINTS[joint]
    load_inertia, load_viscosity, load_stiffness = LOAD_RATIOS[seed % 2]
    trial = simulate_independently(
        seed,
        stiffness=stiffness,
        viscosity=viscosity,
        inertia=inertia,
        gain=gain,
        load=(load_inertia * inertia, load_viscosity * viscosity, load_stiffness * stiffness),
        voluntary=(0.05, 0.5)[seed // 2 % 2],
        **RIGS[rig],
    )
    if rig in ("torque early", "torque late"):
        sign = 1.0 if rig == "torque late" else -1.0
        trial = shift_torque(trial, sign * rng.uniform(5e-5, 5e-4))
    if rig == "quantisation":  # 14 bits over ten times the deviation
        steps = {name: 20.0 * float(trial[name].std()) / 2**14 for name in ("position", "torque")}
        rounded = {name: step * np.round(trial[name] / step) for name, step in steps.items()}
        trial = trial.assign(rounded)
    if rig == "noise of the position":
        noise = 3e-4 * rng.standard_normal(trial.sizes["time"])
        trial = trial.assign(position=trial.position + noise)
    channels = [trial[name].to_numpy() for name in ("position", "torque", "reference")]
    trial = new_trial(channels[0], channels[1], 1000.0, channels[2])
    return trial, dict(zip("KBIG", JOINTS[joint], strict=True))


def make_loud_trial(seed):
    """A trial of a subject who pushes, and its true parameters."""
    rng = np.random.default_rng(seed)
    stiffness, gain = ((150.0, 13.0), (100.0, 8.0))[seed // 2 % 2]
    trial = simulate(
        seed=seed,
        duration=40.0,
        load=LOADS[seed % 2],
        stiffness=stiffness,
        reflex_gain=gain,
        voluntary=rng.uniform(0.5, 2.5),
        voluntary_cutoff=rng.uniform(0.5, 5.0),
        amplitude=10 ** rng.uniform(-3.0, np.log10(0.03)),
    )
    return trial, TRUTHS | {"K": stiffness, "G": gain}


def with_truths(make, *arguments):
    """A trial of the usual joint, and its true parameters."""
    return make(*arguments), TRUTHS


def list_faults(seeds):
    """Kind and maker of each faulty trial."""
    cases = [
        (fault, partial(with_truths, make_faulty_trial, fault, SEED + number))
        for fault in FAULTS
        for number in range(seeds)
    ]
    for effect, (sizes, *_) in EFFECTS.items():
        for size in sizes if effect != GOOD else ():
            for number in range(seeds):
                make = partial(make_trial, effect, size, SEED + 1000 + number)
                cases.append((f"{effect} {size:g}", make))
    return cases


def list_cases():
    """Set, kind and maker of each trial."""
    cases = {
        "faults": list_faults(seeds=6),
        "good": [
            ("good", partial(with_truths, make_good_trial, number, SEED + 2000 + number))
            for number in range(400)
        ],
        "rigs": [
            (f"{joint}, {rig}", partial(make_rig_trial, joint, rig, SEED + 3000 + number))
            for number, (_, joint, rig) in enumerate(itertools.product(range(12), JOINTS, RIGS))
        ],
        "loud": [("loud", partial(make_loud_trial, SEED + 4000 + number)) for number in range(400)],
    }
    return [(name, *case) for name, part in cases.items() for case in part]


def judge(trial, truths):
    """What is said of an estimate by riv, and how far its parameters are off."""
    row = {"check": check_trial(trial).verdict, "refused": "", "warnings": "", "remarks": ""}
    try:
        estimate = identify(trial, "riv")
    except DataError as error:
        return row | {"refused": str(error)}
    row["warnings"] = " ".join(estimate.warnings)
    row["remarks"] = " ".join(estimate.diagnostics.get("remarks", ()))
    values = estimate.values
    errors = {}
    misses = []
    for name, truth in truths.items():
        value = values.get(name, np.nan)
        low, high = estimate.intervals.get(name, (np.nan, np.nan))
        errors[name] = (value - truth) / (truth or TRUTHS[name])
        row |= {name: value, f"{name}_error": errors[name]}
        row[f"{name}_width"] = 0.5 * (high - low) / abs(truth or TRUTHS[name])
        row[f"{name}_held"] = low <= truth <= high if np.isfinite(low) else np.nan
        if abs(errors[name]) > RIGHT and not low <= truth <= high:
            misses.append(name)
    row["right"] = all(abs(error) <= RIGHT for error in errors.values() if np.isfinite(error))
    row["missed"] = ", ".join(misses)
    row["within tolerance"] = all(
        abs(error) <= TOLERANCE for error in errors.values() if np.isfinite(error)
    )
    return row


def judge_case(case):
    """Outcome of one record, as a row."""
    name, kind, make = case
    return {"set": name, "kind": kind, **judge(*make())}


def judge_cases(sets=SETS, every=1):
    """Outcomes of the records of some sets, a row for each."""
    cases = [case for case in list_cases()[::every] if case[0] in sets]
    with ProcessPoolExecutor() as pool:
        return pd.DataFrame(pool.map(judge_case, cases))


def count_by_chance(outcomes):
    """How many estimates 95 % intervals that hold what they say leave silently wrong."""
    held = np.ones(len(outcomes))
    for name in TRUTHS:
        width = outcomes[f"{name}_width"].to_numpy(float)
        limit = np.maximum(width, RIGHT) / width * special.ndtri(0.975)
        held *= 1.0 - np.nan_to_num(2.0 * special.ndtr(-limit))
    return np.sum(1.0 - held)


def summarise(outcomes):
    """Counts of each set."""
    rows = []
    for name, part in outcomes.groupby("set", sort=False):
        given = part[part["refused"] == ""]
        right = given[given["right"].eq(True)]
        near = given[given["within tolerance"].eq(True)]
        warned = given["warnings"] != ""
        silent = given[~warned & (given["missed"] != "")]
        rows.append(
            {
                "set": name,
                "records": len(part),
                "refused": len(part) - len(given),
                "refused by the check": int((part["check"] == "refused").sum()),
                "right": len(right),
                "right, warned of": int((right["warnings"] != "").sum()),
                "right, remarked": int(
                    ((right["remarks"] != "") & (right["warnings"] == "")).sum()
                ),
                "within the tolerance": len(near),
                "within it, warned of": int((near["warnings"] != "").sum()),
                "silently wrong": len(silent),
                "by chance alone": f"{count_by_chance(given[~warned]):.0f}",
                "of kinds listed as invisible": int(silent["kind"].str.startswith(INVISIBLE).sum()),
                "K held [%]": f"{100 * given['K_held'].mean():.1f}",
                "half-width of K [%]": f"{100 * given['K_width'].median():.1f}",
            }
        )
    return format_table(rows)


def main():
    """Print the counts of some sets, or of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", default=SETS)
    parser.add_argument("--rows", help="file for the outcome of each record (CSV)")
    parser.add_argument(
        "--every", type=int, default=1, help="take every n-th record; an odd number keeps all loads"
    )
    arguments = parser.parse_args()
    outcomes = judge_cases(arguments.sets, arguments.every)
    if arguments.rows:
        outcomes.to_csv(arguments.rows, index=False)
    print(summarise(outcomes))


if __name__ == "__main__":
    main()
