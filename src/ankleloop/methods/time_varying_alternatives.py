"""What the model of `riv-tv` may lack: scores of the effects of `ankleloop.methods.riv_alternatives`."""

from __future__ import annotations

import numpy as np
from numpy.fft import irfft

from ankleloop.methods.riv_alternatives import Alternative, compute_shifts
from ankleloop.methods.riv_equations import solve_scaled
from ankleloop.methods.time_varying_search import TimeVaryingSolution

__all__ = ["find_time_varying_alternatives"]

EFFECTS = ("lag", "high-pass", "friction", "compression", "direction", "delay")


def find_time_varying_alternatives(solution: TimeVaryingSolution) -> list[Alternative]:
    """Effects with their scores, and how far the means of K, B, I and G move with one step towards each of them."""
    e, system, linear = solution.equations, solution.system, solution.parameters.linear
    residual, inverse = system.residual(linear), solve_scaled(solution.matrix, np.eye(len(system.normal)))
    noise = e.noise(solution.parameters)
    weight = e.weight(noise)
    whiten = e.whitener(weight, e.level(noise, weight))
    scale = np.sqrt(solution.variance * (1.0 + e.smoothing_variance))
    alternatives = []
    estimated = {"delay": e.estimate_delay, "lag": e.estimate_lag}
    for effect in (name for name in EFFECTS if not estimated.get(name)):
        regressor, instrument = (whiten(row[None])[0] for row in _rows(effect, solution))
        instrument = instrument - (instrument @ system.regressors.T) @ inverse @ system.instruments
        side = instrument @ residual
        score = side / (scale * np.linalg.norm(e.colour(instrument[None], residual)))
        step = side / (instrument @ regressor)
        moved = -step * (inverse @ (system.instruments @ regressor))
        shifts = compute_shifts(e.means(linear), e.means(linear + moved[: linear.size]))
        value = e.delay + solution.parameters.shift + step if effect == "delay" else step
        alternatives.append(Alternative(effect, float(value), float(score), shifts))
    return alternatives


def _rows(effect: str, solution: TimeVaryingSolution) -> tuple[np.ndarray, np.ndarray]:
    """Spectra of the derivatives of the torque with respect to an effect, by measured and by predicted inputs."""
    e, parameters = solution.equations, solution.parameters
    inputs, s = e.inputs, np.where(e.inside, e.inputs.s, 1.0)
    response = e.responses(parameters)[0]
    gain, motion = parameters.linear[e.bases.blocks[2]], parameters.linear[: len(e.motion)]
    predicted = motion @ e.predicted_motion + response * (gain @ e.predicted_drive)
    torque = e.lead(parameters)
    if effect == "lag":
        return -s * torque, -s * predicted
    if effect == "high-pass":
        return -torque / s, -predicted / s
    if effect == "compression":
        signals = (irfft(spectrum, inputs.size)[: inputs.grid.samples] for spectrum in (torque, predicted))
        first, second = (inputs.spectra(-(signal[None] ** 3))[0] for signal in signals)
        return first, second
    if effect == "delay":
        return -s * response * (gain @ e.drive), -s * response * (gain @ e.predicted_drive)
    velocities = inputs.motion[1], (inputs.motion if inputs.own_instruments else inputs.predicted_motion)[1]
    if effect == "friction":
        return inputs.spectra(np.sign(velocities[0])[None])[0], inputs.spectra(np.sign(velocities[1])[None])[0]
    drives = inputs.drive(e.delay), (inputs.drive if inputs.own_instruments else inputs.predicted_drive)(e.delay)
    late = np.exp(-inputs.s * e.delay)
    first, second = (
        response * (inputs.spectra(drive[None])[0] - late * inputs.spectra(velocity[None])[0])
        for drive, velocity in zip(drives, velocities, strict=True)
    )
    return first, second
