"""Start of a search: the best of a grid of reflex dynamics and delays, with linear parameters by least squares."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ankleloop.joint.dynamics import GRIDS, respond
from ankleloop.joint.regressors import MOTION
from ankleloop.signals.spectra import Band

START_DELAYS = np.arange(0.02, 0.121, 0.01)  # s: candidates for an unknown delay
SMALLEST_PIVOT = 1e-12  # of scaled normal equations


@lru_cache(maxsize=2)
def make_grid(
    band: Band, order: int, delay: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shifts of a delay from which a search may start, responses of the dynamics from which it may, and of the shifts.

    Shapes: returns shifts (D,), responses (R, F), delays (D, F).
    """
    shifts = np.zeros(1) if delay is None else START_DELAYS - delay
    return shifts, respond(GRIDS[order], band.s), np.exp(-np.outer(shifts, band.s))


def fit_grid(
    inputs: np.ndarray,
    torque: np.ndarray,
    responses: np.ndarray,
    delays: np.ndarray,
    noise: np.ndarray,
) -> tuple[np.ndarray, int, np.ndarray]:
    """Linear parameters of the best filter of the reflex, its number, and what it leaves of the torque.

    The filters are all pairs of a response and a delay, the latter counting first. They are fitted in one pass.

    Shapes: inputs (3 + k, F), torque (F,), responses (R, F), delays (D, F), noise (F,); returns (3 + k,), residual
    (F,).
    """
    intrinsic = inputs[:MOTION]
    drive = inputs[MOTION:]
    normal, right = _make_normal_equations(intrinsic, drive, torque, responses, delays, noise)
    scale = 1.0 / np.sqrt(np.einsum("gii->gi", normal))
    scaled = normal * scale[:, :, None] * scale[:, None] + SMALLEST_PIVOT * np.eye(len(inputs))
    linear = scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0]
    explained_energy = np.sum(right * linear, axis=1)
    best = int(np.argmax(explained_energy))
    number, late = divmod(best, len(delays))
    values = linear[best]
    reflex = responses[number] * delays[late] * (values[MOTION:] @ drive)
    return values, best, torque - values[:MOTION] @ intrinsic - reflex


def _make_normal_equations(
    intrinsic: np.ndarray,
    drive: np.ndarray,
    torque: np.ndarray,
    responses: np.ndarray,
    delays: np.ndarray,
    noise: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations for each filter of the drive, and their right sides.

    Shapes: intrinsic (3, F), drive (k, F), others as in `fit_grid`; returns (R D, 3 + k, 3 + k), (R D, 3 + k).
    """
    k = len(drive)
    filters = len(responses) * len(delays)
    weighted = intrinsic.conj() / noise
    # Products with filtered drives, of the intrinsic inputs and of the torque, for all filters at once.
    crossed = (weighted[:, None] * drive).reshape(MOTION * k, -1)
    rows = np.vstack([crossed, drive * torque.conj() / noise])
    delayed = (delays[:, None] * rows).reshape(len(delays) * len(rows), -1)
    products = np.real(responses @ delayed.T).reshape(filters, -1)
    cross = products[:, : MOTION * k].reshape(-1, MOTION, k)
    drive_side = products[:, MOTION * k :]
    # A delay does not change the power of a drive.
    power = np.real(drive.conj()[:, None] * drive / noise).reshape(k * k, -1)
    drive_normal = np.abs(responses) ** 2 @ power.T
    normal = np.empty((filters, MOTION + k, MOTION + k))
    normal[:, :MOTION, :MOTION] = np.real(weighted @ intrinsic.T)
    normal[:, :MOTION, MOTION:] = cross
    normal[:, MOTION:, :MOTION] = np.swapaxes(cross, 1, 2)
    normal[:, MOTION:, MOTION:] = np.repeat(drive_normal, len(delays), axis=0).reshape(-1, k, k)
    intrinsic_side = np.tile(np.real(weighted @ torque), (filters, 1))
    return normal, np.hstack([intrinsic_side, drive_side])
