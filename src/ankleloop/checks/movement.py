"""Whether the movement of a record, its torque and its reference can carry an estimate, from a few inner products."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from ankleloop.checks.findings import Finding
from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial, once
from ankleloop.joint.regressors import MOTION, Grid, Regressors
from ankleloop.quantities import QUANTITIES, STIFFNESS
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.least_squares import solve_scaled
from ankleloop.signals.noise import NOISE_SHARE, describe_noise
from ankleloop.signals.responses import ReferenceProjection, project_on_reference, unseen_share
from ankleloop.signals.spectra import mean_power, segment_spectra
from ankleloop.subspace.hankel import hankel_gram
from ankleloop.trials.channels import VARIABLES
from ankleloop.trials.trial import REQUIRED

# rad and N·m: squares of anything beyond leave the range of numbers.
SMALLEST_DEVIATION, LARGEST_DEVIATION = 1e-12, 1e12
BAND_SHARE = 3e-4  # of the recorded range: decimation has to leave so large a deviation
LARGEST_POSITION = 1.0  # rad, standard deviation: no joint can move so far
# N·m/rad, torque over position: from a finger to a leg that stands.
SMALLEST_RATIO, LARGEST_RATIO = 0.1, 1e5
UNRELATED_DURATION = (
    1.0  # s over the duration is the share of the torque that it explains by chance
)
UNRELATED_LIMITS = (0.02, 0.1)
# The same for the share of the position that leads and lags of an unrelated reference explain.
WEAK_DURATION = 5.0  # s
WEAK_LIMITS = (0.05, 0.15)
# Share that a single lag explains: leads and lags together explain more than the weakest reference.
STRONG_SHARE = 0.2
REFERENCE_LEAD, REFERENCE_LAG = 0.02, 0.1  # s, of the single lags
COPY_SHARE = 1e-6  # of a channel that its copy leaves
UNFILTERED_RATE = 1000.0  # Hz: at half of it nothing is left of a torque
# Of the largest density, at the edge of the band: measured, 2.9e-4 or more where every fifth sample of 1 kHz is kept
# (60 trials), 2.4e-5 of every second one; up to 6.2e-4 behind a filter at 200 Hz, which the slope tells apart.
EDGE_DENSITY = 2.5e-4
EDGE_SLOPE = 0.63  # density at the edge over that at three quarters of the band
EXCITED_SHARE = 1e-6  # of the largest eigenvalue of the velocity's Hankel products


@dataclass(frozen=True, eq=False)
class MotionFit:
    """Movement and torque of the decimated samples of a record, and least squares of the torque on the movement."""

    grid: Grid  # its decimated samples
    # Shape (4, N): position, velocity, acceleration and torque, each less its mean.
    signals: np.ndarray
    # Shape (3,): K, B and I of a model without a reflex by least squares.
    stiffness: np.ndarray
    explained: float  # share of the torque's variance that this model explains

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations of position and torque."""
        position, *_, torque = self.signals.std(axis=1)
        return position, torque


@once
def motion_products(trial: PreparedTrial, grid: Grid) -> MotionFit:
    """Least squares of the torque of a trial on its movement, by their inner products; what is not shown is zero."""
    signals = [*trial.motion(grid), trial.channel("torque", grid)]
    deviations = np.stack([signal - signal.mean() for signal in signals])
    products = deviations @ deviations.T
    right = products[:-1, -1]
    stiffness = solve_scaled(products[:-1, :-1], right)
    explained = (right @ stiffness) / products[-1, -1]
    return MotionFit(grid, deviations, stiffness, explained)


def select_references(records: Sequence[Regressors]) -> list[np.ndarray]:
    """References of the records that have one, shapes (N,)."""
    return [record.reference for record in records if record.reference is not None]


def project_records(records: Sequence[Regressors]) -> ReferenceProjection:
    """Position, velocity, acceleration and torque of records, and what their reference does not explain of them."""
    channels = [np.column_stack([record.inputs[:, :MOTION], record.torque]) for record in records]
    return project_on_reference(select_references(records), channels, records[0].rate)


def regress_torque_by_reference(projection: ReferenceProjection) -> list[np.ndarray]:
    """K, B and I of each projected record by two-stage least squares, which fed-back torque does not bias.

    Shapes: returns (3,).
    """
    fits = []
    for signals, residuals in zip(projection.signals, projection.residuals, strict=True):
        torque = signals[:, MOTION]
        motion = signals[:, :MOTION]
        instruments = motion - residuals[:, :MOTION]
        fits.append(solve_scaled(instruments.T @ motion, instruments.T @ torque))
    return fits


def check_scale(trial: PreparedTrial, motion: MotionFit) -> Finding:
    """Position and torque that can be computed with, and that lie within the band of the identification."""
    for name, deviation in zip(REQUIRED, motion.deviations, strict=True):
        if not SMALLEST_DEVIATION < deviation < LARGEST_DEVIATION:
            unit = VARIABLES[name][0]
            text = (
                f"the {name} has a standard deviation of {deviation:.3g} {unit}, and {SMALLEST_DEVIATION:g} … "
                f"{LARGEST_DEVIATION:g} {unit} can be computed with: check its unit."
            )
            return Finding("scale", "refused", text)
        if deviation < BAND_SHARE * np.ptp(trial.samples[name]):
            highest = PASSBAND * trial.rate / motion.grid.factor
            text = f"the {name} has nothing below {highest:.3g} Hz, the band of the identification: raise its rate."
            return Finding("scale", "refused", text)
    position, torque = motion.deviations
    return Finding(
        "scale", "ok", f"standard deviations of {position:.3g} rad and {torque:.3g} N·m."
    )


def check_size(motion: MotionFit) -> Finding:
    """Position and torque of a size that a joint can have, in rad and N·m."""
    position, torque = motion.deviations
    ratio = torque / position if position > 0.0 else inf
    text = f"standard deviations of {position:.3g} rad and {torque:.3g} N·m, {ratio:.3g} N·m/rad"
    if position <= LARGEST_POSITION and SMALLEST_RATIO < ratio < LARGEST_RATIO:
        return Finding("size", "ok", f"{text}.")
    return Finding(
        "size",
        "refused",
        f"{text}, are not those of a joint: K, B, I and G are not either. Are position and torque exchanged, or in "
        "other units than rad and N·m?",
    )


def turned_signs(trial: PreparedTrial) -> dict[str, int]:
    """Signs that turn position and torque round, as options of `read_trial`: the opposite of those it was read with."""
    names = ("position_sign", "torque_sign")
    return {name: 1 if trial.trial.attrs.get(name) == -1 else -1 for name in names}


def check_sign(trial: PreparedTrial, stiffness: np.ndarray) -> Finding:
    """Positive stiffness and inertia; by instruments in closed loop, where the bias of least squares can turn them.

    A stiffness that is nearly zero, as that of a rotor, has any sign: the inertia has to agree. The viscosity is no
    witness, since the reflex is part of it here.

    Shapes: stiffness (3,).
    """
    values = dict(zip(STIFFNESS, stiffness, strict=True))
    numbers = [f"{name} = {value:.3g} {QUANTITIES[name].unit}" for name, value in values.items()]
    text = f"a second-order model without reflex has {', '.join(numbers)}"
    if values["K"] < 0.0 and values["I"] < 0.0:
        turned_sign = turned_signs(trial)["torque_sign"]
        return Finding(
            "sign of the torque",
            "refused",
            f"{text}: the torque has the other sign. Set torque_sign: {turned_sign} (turn round the torque, not the "
            "position: the rectifier would see the wrong half).",
            {"torque_sign": turned_sign},
        )
    return Finding("sign of the torque", "ok", f"{text}: the torque opposes stretch.")


def check_velocity(trial: PreparedTrial) -> Finding:
    """Noise of the position, which reaches the rectified velocity."""
    noise = trial.velocity_noise
    if noise is None:
        return Finding("velocity", "ok", "its noise is not judged.")
    if noise.share < NOISE_SHARE:
        return Finding("velocity", "ok", "its power is that of a movement.")
    text = describe_noise(noise)
    if noise.dominates:
        return Finding("velocity", "ok", f"{text}, which is left out of it.")
    return Finding(
        "velocity",
        "warning",
        f"{text}, beside movement. The reflex answers the velocity that is recorded, so G is too large. Record the "
        "position with less noise, or filter it and all other channels alike.",
    )


@once
def check_bandwidth(trial: PreparedTrial) -> Finding:
    """Torque that was sampled without a filter: its spectrum goes on, flat, to half of the sampling rate.

    What lies beyond appears at other frequencies, where the model takes it for torque of the movement.
    """
    ok = Finding("bandwidth", "ok", "the torque was sampled fast enough.")
    length = 2 * round(trial.rate)
    torque = trial.samples["torque"]
    if trial.rate >= UNFILTERED_RATE or torque.size < 5 * length:
        return ok
    density = mean_power(segment_spectra([torque], length, length // 2))
    place = np.linspace(0.0, 1.0, density.size)  # of half of the sampling rate
    largest = density[place < 0.3].max()
    inside = density[(place >= 0.7) & (place < 0.8)].mean()
    edge = density[(place >= 0.94) & (place < 0.995)].mean()
    if edge < EDGE_DENSITY * largest or edge < EDGE_SLOPE * inside:
        return ok
    text = (
        f"the spectrum of the torque does not fall towards {trial.rate / 2:g} Hz, half of its rate: samples were "
        "left out without a filter, and what lies beyond appears within the band. I and B are too small. Filter before "
        "samples are left out (scipy.signal.decimate), or record at a higher rate."
    )
    return Finding("bandwidth", "warning", text)


def check_relation(trial: PreparedTrial, motion: MotionFit) -> Finding:
    """Torque that has something to do with the movement."""
    text = f"position, velocity and acceleration explain {100.0 * motion.explained:.2g} % of the torque"
    duration = trial.time.size / trial.rate
    by_chance = np.clip(UNRELATED_DURATION / duration, *UNRELATED_LIMITS)
    if not motion.explained >= by_chance:
        return Finding(
            "relation",
            "refused",
            f"{text}, as those of any other record would: K, B, I and G say nothing about the joint. Check the "
            "channels and the perturbation.",
        )
    return Finding("relation", "ok", f"{text}.")


def check_excitation(velocities: Sequence[np.ndarray], order: int, block_rows: int) -> Finding:
    """Rank of the velocity's Hankel matrix: a movement of q sinusoids is exciting of order 2 q.

    Shapes: velocities (N,).
    """
    rows = 2 * block_rows + order
    samples = max(map(len, velocities))
    if samples < 2 * rows:
        text = f"{samples} samples are too few for {block_rows} block rows and order {order}: take fewer block rows."
        return Finding("excitation", "refused", text)
    # Decimation leaves the uppermost part of the band empty, which limits the rank of any movement.
    attainable = int(np.floor(2 * PASSBAND * rows))
    columns = [velocity[:, None] for velocity in velocities]
    grams = [hankel_gram(column, rows, subtract_means=False) for column in columns]
    eigenvalues = np.linalg.eigvalsh(np.sum(grams, axis=0))
    rank = np.count_nonzero(eigenvalues > EXCITED_SHARE * eigenvalues[-1])
    if rank >= attainable:
        return Finding(
            "excitation", "ok", f"persistent for order {order} and {block_rows} block rows."
        )
    verdict = "refused" if rank < 2 * (order + 3) else "warning"
    text = (
        f"the movement excites {rank} of {attainable} directions that {block_rows} block rows and order {order} "
        "need: perturb with a pseudorandom sequence, or take fewer block rows."
    )
    return Finding("excitation", verdict, text)


def check_reference(records: Sequence[Regressors]) -> Finding:
    """Whether the reference can serve as an instrument."""
    name = records[0].reference_name
    rate = records[0].rate
    positions = [record.inputs[:, 0] for record in records]
    try:
        share = unseen_share(select_references(records), positions, rate)
    except DataError as error:
        text = f"what {name} explains of the position cannot be told: {error}"
        return Finding("reference", "warning", text)
    text = f"{name} explains {100 * max(share, 0.0):.1f} % of the position in unseen halves"
    duration = sum(map(len, positions)) / rate
    limit = np.clip(WEAK_DURATION / duration, *WEAK_LIMITS)
    if share < limit:
        return Finding(
            "reference",
            "refused",
            f"{text}, and chance alone up to {100 * limit:.2g} % in {duration:.3g} s: it is too weak an instrument. "
            "Is it the command of the servo? Give that as reference; reference='position' is for records in open loop.",
        )
    return Finding("reference", "ok", f"{text}.")


@once
def reference_correlations(
    trial: PreparedTrial, grid: Grid, name: str
) -> tuple[float, float, float]:
    """Squared correlations of the reference: the largest with the position a little later, and those at once."""
    rate = trial.rate / grid.factor
    lead = round(REFERENCE_LEAD * rate)
    lag = round(REFERENCE_LAG * rate)
    if grid.samples - lead - lag < 2:
        return 0.0, 0.0, 0.0
    recorded = trial.channel(name, grid)
    reference = recorded - recorded.mean()
    position, *_, torque = motion_products(trial, grid).signals
    _, by_position, by_torque = np.corrcoef([reference, position, torque])[0] ** 2
    shifted = np.correlate(position, reference[lead : reference.size - lag], mode="valid")
    later = np.max(shifted**2) / ((reference @ reference) * (position @ position))
    return later, by_position, by_torque
