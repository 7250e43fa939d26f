"""What the model of `riv-tv` may lack: one step towards each effect."""

from __future__ import annotations

import numpy as np

from ankleloop.methods.riv.alternatives import Alternative, compute_shifts
from ankleloop.methods.riv_tv.equations import Inputs
from ankleloop.methods.riv_tv.solution import TimeVaryingSolution

EFFECTS = ("torque_lag", "high-pass", "friction", "compression", "direction", "delay")


def find_alternatives(solution: TimeVaryingSolution) -> list[Alternative]:
    """Effects with their scores, and how far the means of K, B, I and G move with one step towards each of them."""
    equations = solution.equations
    parameters = solution.parameters
    system = solution.system
    whitener = equations.noise_whitener(parameters)
    scale = np.sqrt(solution.variance * (1.0 + equations.noise.weight_variance))
    predicted_torque = parameters.torque(
        equations.predicted.intrinsic, equations.predicted.drive, equations.transform.s
    )
    sides = [
        (equations.measured, equations.lead(parameters)),
        (equations.predicted, predicted_torque),
    ]
    alternatives = []
    for effect in EFFECTS:
        if effect in parameters.delays:
            continue
        regressor, instrument = (
            whitener(_differentiate(effect, solution, *side)) for side in sides
        )
        # What the instruments of the other unknowns leave of it.
        common = (instrument @ system.regressors.T) @ solution.inverse
        own = instrument - common @ system.instruments
        left = own @ solution.residual
        error = scale * np.linalg.norm(equations.noise.colour(own, solution.residual))
        size = left / (own @ regressor)
        step = -size * (solution.inverse @ (system.instruments @ regressor))
        moved = parameters.linear + step[: parameters.linear.size]
        shifts = compute_shifts(solution.means, equations.bases.means(moved))
        alternatives.append(Alternative(effect, float(size), float(left / error), shifts))
    return alternatives


def _differentiate(
    effect: str, solution: TimeVaryingSolution, inputs: Inputs, torque: np.ndarray
) -> np.ndarray:
    """Transform of the derivative of the torque with respect to an effect, by inputs and the torque of them.

    Shapes: torque (frequencies,); returns (frequencies,).
    """
    equations = solution.equations
    transform = equations.transform
    if effect == "torque_lag":
        return -transform.s * torque
    if effect == "high-pass":
        return -torque / np.where(equations.noise.inside, transform.s, 1.0)
    if effect == "compression":
        return -equations.spectra(transform.signals(torque) ** 3)
    velocity = inputs.motion.velocity
    if effect == "friction":
        return equations.spectra(np.sign(velocity))
    response = solution.parameters.responses(transform.s)[0]
    if effect == "delay":
        gain = solution.parameters.linear[equations.bases.blocks["G"]]
        return -transform.s * response * (gain @ inputs.drive)
    rectified = equations.spectra(inputs.motion.rectify(equations.delay))
    late = np.exp(-transform.s * equations.delay)
    return response * (rectified - late * equations.spectra(velocity))
