"""What the model of `riv-tv` may lack: effects of an instrument or of the joint, by one step towards each of them."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft

from ankleloop.methods.riv.alternatives import Alternative, compute_shifts
from ankleloop.methods.riv.equations import solve_scaled
from ankleloop.methods.riv_tv.equations import MEASURED, PREDICTED
from ankleloop.methods.riv_tv.search import TimeVaryingSolution

EFFECTS = ("lag", "high-pass", "friction", "compression", "direction", "delay")
UNKNOWNS = {"lag": "torque_lag", "delay": "delay"}


def find_alternatives(solution: TimeVaryingSolution) -> list[Alternative]:
    """Effects with their scores, and how far the means of K, B, I and G move with one step towards each of them."""
    e, system, linear = solution.equations, solution.system, solution.parameters.linear
    residual = system.residual(linear)
    inverse = solve_scaled(system.normal + solution.penalty, np.eye(len(system.normal)))
    whiten = e.noise_whitener(e.noise(solution.parameters))
    scale = np.sqrt(solution.variance * (1.0 + e.smoothing_variance))
    alternatives = []
    for effect in EFFECTS:
        if UNKNOWNS.get(effect) in solution.parameters.delays:
            continue
        regressor, instrument = (whiten(_row(effect, solution, side)) for side in (MEASURED, PREDICTED))
        instrument = instrument - (instrument @ system.regressors.T) @ inverse @ system.instruments
        left = instrument @ residual
        score = left / (scale * np.linalg.norm(e.colour(instrument, residual)))
        step = left / (instrument @ regressor)
        moved = -step * (inverse @ (system.instruments @ regressor))
        shifts = compute_shifts(e.means(linear), e.means(linear + moved[: linear.size]))
        value = e.delay + solution.parameters.shift + step if effect == "delay" else step
        alternatives.append(Alternative(effect, float(value), float(score), shifts))
    return alternatives


def _row(effect: str, solution: TimeVaryingSolution, side: int) -> np.ndarray:
    """Transform of the derivative of the torque with respect to an effect, by measured or by predicted inputs."""
    e, parameters = solution.equations, solution.parameters
    inputs, s = e.inputs, np.where(e.inside, e.inputs.s, 1.0)
    torque = e.lead(parameters) if side == MEASURED else e.predict_torque(parameters, side)
    if effect == "lag":
        return -s * torque
    if effect == "high-pass":
        return -torque / s
    if effect == "compression":
        return -inputs.spectra(irfft(torque, inputs.size)[: inputs.grid.samples] ** 3)
    velocity, response = e.motions[side].signals[1], parameters.responses(inputs.s)[0]
    if effect == "friction":
        return inputs.spectra(np.sign(velocity))
    if effect == "delay":
        return -s * response * (parameters.linear[e.bases.blocks[2]] @ e.drive[side])
    late = np.exp(-inputs.s * e.delay)
    return response * (inputs.spectra(e.motions[side].drive(e.delay)) - late * inputs.spectra(velocity))
