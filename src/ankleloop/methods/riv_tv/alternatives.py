"""What the model of `riv-tv` may lack: one step towards each effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ankleloop.methods.riv.alternatives import Alternative, compute_shifts, normal_score
from ankleloop.methods.riv.effects import EFFECTS, Channels, list_effects
from ankleloop.methods.riv_tv.equations import Inputs
from ankleloop.methods.riv_tv.solution import TimeVaryingSolution
from ankleloop.signals.least_squares import invert_scaled


def find_alternatives(solution: TimeVaryingSolution) -> list[Alternative]:
    """Effects with their scores, and how far the means of K, B, I and G move with one step towards each of them."""
    equations = solution.equations
    parameters = solution.parameters
    effects = list_effects(open_loop=equations.open_loop, passive=parameters.passive)
    if "torque_lag" in parameters.delays:
        effects.remove("torque_lag")
    whitener = equations.noise_whitener(parameters)
    predicted_torque = parameters.torque(
        equations.predicted.intrinsic, equations.predicted.drive, equations.transform.s
    )
    measured = _list_channels(solution, equations.measured, equations.lead(parameters))
    predicted = _list_channels(solution, equations.predicted, predicted_torque)
    alternatives = []
    for name in effects:
        regressors = whitener(EFFECTS[name].rows(measured))
        instruments = whitener(EFFECTS[name].rows(predicted))
        alternatives.append(_step(name, solution, regressors, instruments))
    if "delay" not in parameters.delays and not parameters.passive:
        delayed = replace(parameters, delays=("delay",))
        slopes = [
            whitener(delayed.differentiate(inputs.intrinsic, inputs.drive, equations.transform.s))
            for inputs in (equations.measured, equations.predicted)
        ]
        alternatives.append(_step("delay", solution, slopes[0][-1:], slopes[1][-1:]))
    return alternatives


def _step(
    name: str, solution: TimeVaryingSolution, regressors: np.ndarray, instruments: np.ndarray
) -> Alternative:
    """A step towards an effect.

    Shapes: regressors, instruments (sizes, rows): whitened derivatives of the torque, measured and predicted.
    """
    equations = solution.equations
    system = solution.system
    # What the instruments of the other unknowns leave of it.
    common = (instruments @ system.regressors.T) @ solution.inverse
    own = instruments - common @ system.instruments
    inverse = invert_scaled(own @ regressors.T)
    sizes = inverse @ (own @ solution.residual)
    coloured = equations.noise.colour(own, solution.residual)
    variance = solution.variance * (1.0 + equations.noise.weight_variance)
    covariance = variance * inverse @ coloured @ coloured.T @ inverse.T
    step = -solution.inverse @ (system.instruments @ (sizes @ regressors))
    linear = solution.parameters.linear
    shifts = compute_shifts(
        solution.shown_means, equations.bases.means(linear + step[: linear.size])
    )
    return Alternative(name, np.squeeze(sizes), normal_score(sizes, covariance), shifts)


def _list_channels(solution: TimeVaryingSolution, inputs: Inputs, torque: np.ndarray) -> Channels:
    """Signals of effects, by inputs and the torque of them.

    Shapes: torque (frequencies,).
    """
    equations = solution.equations
    transform = equations.transform
    motion = inputs.motion
    return Channels(
        position=motion.position,
        velocity=motion.velocity,
        motion=equations.spectra(np.stack([motion.position, motion.velocity])),
        torque=torque,
        recorded=torque,
        rectified=equations.spectra(motion.rectify(equations.delay)),
        reference=equations.reference,
        response=solution.parameters.responses(transform.s)[0],
        gain=solution.means["G"],
        delay=equations.delay,
        s=np.where(equations.noise.inside, transform.s, 1.0),
        transform=equations.spectra,
        signals=transform.signals,
    )
