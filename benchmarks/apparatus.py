"""The apparatus: a machine in closed loop beside its published values, and a joint on a device with friction.

The simulator of the library has no friction, so the loop is integrated here, by Heun's method at 10 kHz. The machine is
EMPS (Janot, Gautier and Brunot, 2019), a slide with m and N in the place of rad and N·m; its file is DATA_EMPS.mat in
the folder of the recordings.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from scipy import signal
from tools import format_table

import ankleloop
from ankleloop.kernels import kernel

FINE = 10_000.0  # Hz, of the integration
RATE = 1000.0  # Hz, of the record
SETTLING = 3.0  # s
LOADS = {"moderate": (1.1, 7.1, 250.0), "light": (0.1, 10.0, 100.0)}
TRUTH = {"K": 150.0, "B": 0.8, "I": 0.015, "G": 13.0}
DELAY = 0.04  # s
SERVO = (2 * np.pi * 20.0, 0.8)
REFLEX = (40.0, 1.0)
WANDER = 0.1  # rad, of the command of a device without a subject
CREEP = 1e-3  # rad/s, below which friction is viscous
RECORDERS = (200.0, 400.0)  # Hz, cutoffs of the filters before the recorder
COUNTED = ("K", "B", "I", "G")
PUBLISHED = {"I": 95.11, "B": 203.5, "friction": 20.39, "offset": -3.16}


class Device(NamedTuple):
    """A device: its inertia, viscosity and Coulomb friction."""

    inertia: float = 0.01  # kg·m²
    viscosity: float = 0.1  # N·m·s/rad
    friction: float = 0.6  # N·m


@kernel()
def _integrate(command, disturbance, joint, load, device, servo, reflex, delay, creep, step):
    """Position and torque at each step; the joint is K, B, I and G."""
    stiffness, viscosity, inertia, gain = joint
    load_inertia, load_viscosity, load_stiffness = load
    device_inertia, device_viscosity, friction = device
    mass = inertia + device_inertia
    damping = viscosity + device_viscosity
    samples = command.size
    record = np.empty((2, samples))
    velocities = np.zeros(samples)
    x = np.zeros(6)  # servo, displacement of the load and reflex torque, each with its rate
    slopes = np.zeros((2, 6))
    for k in range(samples):
        y = x.copy()
        for stage in range(2):
            drive = 0.0
            late = k + stage - delay
            if late >= 0:
                drive = max(0.0, velocities[late])
            position = y[0] - y[2]
            velocity = y[1] - y[3]
            acceleration = servo[0] ** 2 * (command[k] - y[0]) - 2.0 * servo[1] * servo[0] * y[1]
            held = stiffness * position + damping * velocity + y[4] + disturbance[k]
            held += friction * np.tanh(velocity / creep)
            bent = held + mass * acceleration - load_viscosity * y[3] - load_stiffness * y[2]
            bent /= load_inertia + mass
            if stage == 0:
                # What jumps counts by the mean of both sides: else the torque would be half a step early.
                last = max(k - 1, 0)
                push = 0.5 * (disturbance[last] - disturbance[k])
                jump = 0.5 * servo[0] ** 2 * (command[last] - command[k])
                yielding = (push + mass * jump) / (load_inertia + mass)
                record[0, k] = position
                record[1, k] = held + push + mass * (acceleration + jump - bent - yielding)
                velocities[k] = velocity
            slopes[stage, 0] = y[1]
            slopes[stage, 1] = acceleration
            slopes[stage, 2] = y[3]
            slopes[stage, 3] = bent
            slopes[stage, 4] = y[5]
            slopes[stage, 5] = (
                reflex[0] ** 2 * (gain * drive - y[4]) - 2.0 * reflex[1] * reflex[0] * y[5]
            )
            if stage == 0:
                for i in range(6):
                    y[i] = x[i] + step * slopes[0, i]
        for i in range(6):
            x[i] += 0.5 * step * (slopes[0, i] + slopes[1, i])
    return record


def simulate_device(
    seed: int,
    device: Device,
    *,
    load: str = "moderate",
    subject: bool = True,
    duration: float = 50.0,
    voluntary: float = 0.05,
    snr_db: float = 10.0,
    recorder: float = RECORDERS[0],
) -> xr.Dataset:
    """A trial of a device, with a joint on it or without; noise and voluntary torque are fed back by the load."""
    rng = np.random.default_rng(seed)
    samples = round((SETTLING + duration) * FINE)
    hold = round(FINE / 10.0)
    command = 0.04 * np.repeat(rng.integers(0, 2, samples // hold + 1) - 0.5, hold)[:samples]
    if not subject:  # it would rest on its friction between two steps
        command += WANDER * _draw_slow(rng, samples, 0.7)
    joint = tuple(TRUTH.values()) if subject else (0.0, 0.0, 0.0, 0.0)
    constants = (
        joint,
        LOADS[load],
        tuple(device),
        SERVO,
        REFLEX,
        round(DELAY * FINE),
        CREEP,
        1.0 / FINE,
    )
    silent = _integrate(command, np.zeros(samples), *constants)
    level = _record(silent[1], recorder)[round(SETTLING * RATE) :].std()
    noise = np.repeat(rng.standard_normal(samples // 100 + 1), 100)[:samples]
    disturbance = level * 10 ** (-snr_db / 20) * noise
    if subject:
        disturbance += level * voluntary * _draw_slow(rng, samples, 2.0)
    position, torque = _integrate(command, disturbance, *constants)
    channels = [
        _record(channel, recorder)[round(SETTLING * RATE) :]
        for channel in (position, torque, command)
    ]
    position, torque, reference = channels
    return ankleloop.new_trial(position, torque, RATE, reference)


def _draw_slow(rng: np.random.Generator, samples: int, cutoff: float) -> np.ndarray:
    """Noise below a frequency [Hz], of unit deviation."""
    filters = signal.bessel(2, cutoff, fs=FINE, norm="mag", output="sos")
    slow = signal.sosfilt(filters, rng.standard_normal(samples))
    return slow / slow.std()


def _record(channel: np.ndarray, cutoff: float) -> np.ndarray:
    """A channel behind the recorder's filter, at the rate of the record."""
    filters = signal.bessel(4, cutoff, fs=FINE, norm="phase", output="sos")
    return signal.sosfilt(filters, channel)[:: round(FINE / RATE)]


def measure_machine(folder):
    """Parameters of the machine by three bands and of its first half, and what `riv` says before and after."""
    trial = ankleloop.read_trial(
        Path(folder, "DATA_EMPS.mat"),
        position="qm",
        torque="vir",
        reference="qg",
        position_unit=1.0,
        torque_unit=35.15,
    )
    middle = 0.5 * float(trial["time"][-1])
    halves = ankleloop.segment(trial, 0.0, middle), ankleloop.segment(trial, middle, 2 * middle)
    bands = {"default, 38 Hz": None, "20 Hz": 20.0, "10 Hz": 10.0}
    estimates = {
        name: ankleloop.identify(trial, "apparatus", highest_frequency=highest)
        for name, highest in bands.items()
    }
    estimates["first half"] = ankleloop.identify(halves[0], "apparatus")
    rows = [{"band": "published", **PUBLISHED}]
    for name, estimate in estimates.items():
        row = {"band": name}
        for parameter in PUBLISHED:
            low, high = estimate.intervals[parameter]
            row[parameter] = f"{estimate[parameter]:.4g} ({low:.4g} … {high:.4g})"
        rows.append(row)
    first = estimates["first half"]
    score = first.predict(halves[1]).vaf_net
    rest = ankleloop.subtract(halves[1], first)
    records = {"as recorded": trial, "second half, less the apparatus of the first": rest}
    joints = [{"record": name, **_describe_joint(t)} for name, t in records.items()]
    return (
        "Mass I [kg], viscosity B [N·s/m], friction [N] and offset [N] of the slide EMPS, with 95 % intervals, beside "
        "the published values, which are least squares of the inverse model in a band of their own.\n\n"
        f"{format_table(rows)}\n\nThe first half predicts {score:.2f} % of the force of the second (VAF). What `riv` "
        "finds, which takes it for a joint, and refuses where nothing is left that answers the movement:\n\n"
        f"{format_table(joints)}"
    )


def _describe_joint(trial):
    """Parameters that `riv` gives a record; it refuses one in which nothing answers the movement."""
    try:
        estimate = ankleloop.identify(trial)
    except ankleloop.DataError:
        return {"K": "refused"}
    values = estimate.values
    return {name: f"{values[name]:.3g}" if name in values else "not shown" for name in COUNTED}


def compare_records(load, records, device):
    """Errors [%] of fresh records, each with an empty record of its own, and whether their intervals hold the truth."""
    rows = []
    for seed in range(records):
        empty = simulate_device(2 * seed, device, load=load, subject=False, duration=30.0)
        trial = simulate_device(2 * seed + 1, device, load=load)
        apparatus = ankleloop.identify(empty, "apparatus")
        limb = ankleloop.identify(ankleloop.subtract(trial, apparatus))
        recorded = ankleloop.identify(trial)
        rows.append(describe("less the apparatus", limb, TRUTH))
        rows.append(describe("as recorded", recorded, TRUTH))
        truth = {"I": device.inertia, "B": device.viscosity, "friction": device.friction}
        rows.append(describe("the apparatus", apparatus, truth))
    return pd.DataFrame(rows)


def describe(kind, estimate, truth):
    """Row of an estimate: its errors, and what it holds."""
    row = {
        "kind": kind,
        "warned": bool(estimate.warnings),
        "named": any("--method apparatus" in text for text in estimate.warnings),
    }
    for name, value in truth.items():
        low, high = estimate.intervals.get(name, (np.nan, np.nan))
        row[name] = 100.0 * (estimate.values.get(name, np.nan) / value - 1.0)
        row[f"{name}_held"] = low < value < high
    return row


def share_apparatus(load, recorder, groups, device, trials=12):
    """Errors [%] of the mean of trials that share the apparatus of a short record, merged and by `compare`."""
    rows = []
    for group in range(groups):
        seed = 100_000 + 100 * group
        more = {"load": load, "recorder": recorder}
        empty = simulate_device(seed, device, subject=False, duration=15.0, **more)
        apparatus = ankleloop.identify(empty, "apparatus")
        limbs = [
            ankleloop.subtract(
                simulate_device(seed + number, device, duration=20.0, **more), apparatus
            ).assign_attrs(subject=f"S{number}", condition="rest")
            for number in range(1, trials + 1)
        ]
        rows.append(describe("merged", ankleloop.identify(limbs), TRUTH))
        table = ankleloop.identify_each(limbs, "riv")
        columns = [name for name in table if name.endswith("_apparatus")]
        for kind, used in (
            ("mean over trials", table),
            ("mean, without the apparatus", table.drop(columns=columns)),
        ):
            means = ankleloop.compare(used).set_index("parameter")
            row = {"kind": kind, "warned": False, "named": False}
            for name, value in TRUTH.items():
                row[name] = 100.0 * (means["value"][name] / value - 1.0)
                row[f"{name}_held"] = means["low"][name] < value < means["high"][name]
            rows.append(row)
    return pd.DataFrame(rows)


def summarise(tables):
    """Mean error ± its standard error [%], and in brackets the share of intervals that hold the truth [%]."""
    rows = []
    for load, table in tables.items():
        for kind, group in table.groupby("kind", sort=False):
            row = {"load": load, "kind": kind}
            for name in (*TRUTH, "friction"):
                errors = group.get(name, pd.Series(dtype=float)).dropna()
                if not errors.empty:
                    error = errors.std() / np.sqrt(errors.size)
                    held = 100.0 * group[f"{name}_held"].mean()
                    row[name] = f"{errors.mean():+.2f} ± {error:.2f} ({held:.0f})"
            row["warned, friction named [%]"] = (
                f"{100 * group['warned'].mean():.0f}, {100 * group['named'].mean():.0f}"
            )
            rows.append(row)
    return format_table(rows)


def measure_apparatus(records=200, groups=40):
    """Sections of the page: the machine where its file is, and simulated records."""
    sections = {}
    folder = os.environ.get("ANKLELOOP_RECORDINGS")
    if folder and Path(folder, "DATA_EMPS.mat").exists():
        sections["A machine in closed loop"] = measure_machine(folder)
    device = Device()
    friction = f"{device.friction:g} N·m of friction"
    words = f"A device of {device.inertia:g} kg·m², {device.viscosity:g} N·m·s/rad and {friction}"
    compared = {load: compare_records(load, records, device) for load in LOADS}
    sections["A joint on a device with friction"] = (
        f"{words} under a joint, 50 s in closed loop at 10 dB, and without one for 30 s; {records} pairs of records "
        "for each load. Mean error ± its standard error [%], in brackets the share of intervals that hold the truth "
        "[%].\n\n"
        f"{summarise(compared)}"
    )
    shared = {
        f"{load}, recorder of {recorder:g} Hz": share_apparatus(load, recorder, groups, device)
        for load in LOADS
        for recorder in RECORDERS
    }
    sections["Twelve trials that share one apparatus"] = (
        f"{words}, known from one empty record of 15 s, and twelve trials of 20 s; {groups} groups for each load. The "
        "last kind leaves the columns of the apparatus out of the table.\n\n"
        f"{summarise(shared)}"
    )
    return sections
