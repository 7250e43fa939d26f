"""Short windows around perturbations of many trials, some of them without: K, B, I and the reflex, in closed loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import NO_REFLEX
from ankleloop.joint.intervals import Uncertainty
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import merge_torques, torque_dataset
from ankleloop.methods.ensemble.equations import EnsembleEquations
from ankleloop.methods.ensemble.options import EnsembleOptions
from ankleloop.methods.ensemble.solution import (
    MOST_ROUNDS,
    EnsembleSolution,
    solve_ensemble,
)
from ankleloop.methods.ensemble.windows import Windows, check_windows, prepare_windows
from ankleloop.methods.method import Method, Validity

WEAKEST = 2.0  # F statistic of instruments that say nothing; good ensembles have 17 and more
WEAK = 10.0  # of weak ones (Staiger and Stock 1997)
INCOMPLETE = 0.01  # probability of the differences of the residual between the conditions
# Of the differences of the torque: less, which noise hardly hides, moves K, B, I and G by less than 0.5 %.
SMALLEST_SHARE = 2e-4
UNBALANCED = 0.01  # probability of the differences of the conditions before the onset
CERTAIN_REFLEX = 4.0  # normal score of G below which it has long tails
REACTION = 0.15  # s: no subject reacts earlier


def identify_ensemble(trials: Sequence[PreparedTrial], options: EnsembleOptions) -> Estimate:
    r"""Estimate K, B, I and the reflex at one moment of a movement from many short windows, in closed loop.

    The windows of trials i lie around a perturbation that was commanded in some of them, in random order, or in
    different ways. The model is, over the time t from the onset,

    .. math:: TQ_i = \left[K + \dot K (t - t_0)\right] P_i + B \dot P_i + I \ddot P_i
              + G\, H\{\max(0, \dot P_i(t - d))\} + e(t) + n_i(t)

    with a low-pass H of unit gain, a torque e that is the same in all trials, as that of posture and movement, and n of
    any covariance over the window: voluntary torque and noise, which the load feeds back to P, and the differences
    between trials. The *condition* of a trial, what was commanded, is the instrument: it was chosen at random, so it
    has nothing to do with n. The derivatives ψ of the torque by the parameters θ, averaged over the other trials of the
    condition, less their mean over all other trials, are z, and

    .. math:: \sum_i z_i^T \hat C^{-1} \left[TQ_i - \overline{TQ}
              - (\hat{TQ}_i - \overline{\hat{TQ}})(\hat\theta)\right] = 0

    with C the covariance of the residual over the window in the other tenths of the trials. What weak instruments bias
    it by, to second order in the noise (`ankleloop.methods.ensemble.solution.EnsembleSolution.bias`), is taken off the
    solution. Intervals come from the influence of each trial, with Student's t of the trials of the smallest condition.

    Parameters
    ----------
    trials : sequence of PreparedTrial
        The windows.
    options : EnsembleOptions

    Returns
    -------
    Estimate
        K is that at the time `moment` after the onset, and `stiffness` has its slope "K_slope", too. `torque` holds for
        each condition, which stand one after the other as trials do, the mean of its trials over the time from the
        onset, less e(t). `diagnostics`: conditions (with their trials), window [s], position (mean of each condition
        [rad]), strength (F statistic of the instruments), movement_p (probability of differences of the residual
        between the conditions at least as large, were the model complete: 199 permutations), movement_share (how much
        of the differences of the torque they are, beyond chance), balance_p (of differences before the onset),
        reflex_score, offsets [N·m], converged.

    Raises
    ------
    DataError
        If the conditions do not differ enough to be instruments.

    References
    ----------
    R. F. Kirsch, R. E. Kearney, J. B. MacNeil, "Identification of time-varying dynamics of the human triceps surae
    stretch reflex", Experimental Brain Research 97, 115-127, 1993. J. D. Angrist, G. W. Imbens, A. B. Krueger,
    "Jackknife instrumental variables estimation", Journal of Applied Econometrics 14(1), 57-67, 1999.

    Examples
    --------
    >>> import numpy as np
    >>> from ankleloop import cut, identify, simulate
    >>> trial = simulate(seed=1, duration=100.0, voluntary=0.1)
    >>> onsets = np.arange(1.0, 98.0, 0.6)  # at which the command goes up or down
    >>> levels = np.sign(trial["reference"].sel(time=onsets + 0.05, method="nearest")).values
    >>> windows = cut(trial, onsets, window=(-0.1, 0.15), condition=levels)
    >>> estimate = identify(windows, "ensemble", slope=False, delay=0.04)
    >>> low, high = estimate.intervals["K"]
    >>> low < 150.0 < high
    True
    """
    windows = Windows.of(trials, options)
    balance_p = windows.balance_p
    offsets = balance_p < UNBALANCED if options.offsets is None else options.offsets
    solution = solve_ensemble(EnsembleEquations(windows, options, offsets=offsets))
    strength = solution.strength
    if strength < WEAKEST:
        raise DataError(
            f"the conditions differ too little to be instruments: their F statistic is {strength:.2g}, and {WEAK:g} is "
            "needed. Trials of a condition have the same command at the same time after the onset: repeat a few "
            "sequences, cut at the recorded command, perturb more strongly."
        )
    if solution.converged:
        solution = solution.remove_bias()
    return _estimate(windows, solution, options, balance_p, strength)


def _estimate(
    windows: Windows,
    solution: EnsembleSolution,
    options: EnsembleOptions,
    balance_p: float,
    strength: float,
) -> Estimate:
    """Torques of the conditions, parameters, and where the search has converged their intervals."""
    parameters = solution.parameters
    linear = dict(zip(solution.names, parameters.linear.tolist(), strict=False))
    reflex = {"delay": solution.delay, "G": linear.pop("G")}
    missing = [f"ωn and ζ: {NO_REFLEX}."]
    if not parameters.passive:
        reflex |= parameters.dynamics.values
        missing = []
    values = {**linear, **reflex}
    uncertainty = Uncertainty()
    if solution.converged:
        freedom = windows.sizes.min() - 1
        uncertainty = Uncertainty.of(values, solution.rows, solution.covariance, freedom)
    end = windows.time[-1]
    assumptions = []
    if end > REACTION:
        assumptions = [
            f"nobody reacts to the perturbation within {1000 * end:.0f} ms: end the window at {1000 * REACTION:.0f} ms "
            "where subjects may."
        ]
    return Estimate(
        method="ensemble",
        torque=_average_torques(windows, solution),
        stiffness=linear,
        reflex=reflex,
        intervals=uncertainty.intervals(values),
        diagnostics={
            "converged": solution.converged,
            "conditions": windows.conditions,
            "window": (float(windows.time[0]), float(end)),
            "position": windows.average(solution.equations.intrinsic[0]),
            "intervals": "influence of trials" if solution.converged else None,
            **uncertainty.diagnostics,
            "strength": strength,
            "movement_p": solution.incomplete_p,
            "movement_share": solution.incomplete_share,
            "balance_p": balance_p,
            "reflex_score": solution.reflex_score,
            "offsets": solution.offsets.tolist(),
            "reference": "condition",
            "missing": missing,
            "assumptions": assumptions,
            "warnings": _warnings(solution, balance_p, strength),
        },
    )


def _average_torques(windows: Windows, solution: EnsembleSolution) -> xr.Dataset:
    """Torques of each condition, means over its trials, less what is the same in all trials."""
    linear = solution.parameters.linear
    size = linear.size - 1  # G is the last one
    means = windows.average(solution.columns[: size + 1])
    intrinsic = np.tensordot(linear[:size], means[:size], 1)
    reflex = linear[size] * means[size]
    measured = intrinsic + reflex + windows.average(solution.residual)
    return merge_torques(
        [
            torque_dataset(
                windows.time,
                windows.rate / np.diff(windows.rows[:2]).item(),
                net=intrinsic[number] + reflex[number],
                intrinsic=intrinsic[number],
                reflex=reflex[number],
                measured=measured[number],
            )
            for number in range(windows.sizes.size)
        ]
    )


def _warnings(solution: EnsembleSolution, balance_p: float, strength: float) -> list[str]:
    """What the windows do not show, or the search did not reach."""
    warnings = []
    if not solution.converged:
        warnings.append(
            f"not converged after {MOST_ROUNDS} rounds: there are no intervals. The windows hardly show some of the "
            "parameters; or a reaction of the subject lies within them: end them earlier."
        )
    if strength < WEAK:
        warnings.append(
            f"the instruments are weak: the F statistic of the conditions is {strength:.2g}, and {WEAK:g} is needed. "
            "Record more trials, or perturb more strongly."
        )
    if solution.incomplete_p <= INCOMPLETE and solution.incomplete_share > SMALLEST_SHARE:
        warnings.append(
            "the conditions differ in a part of the torque that the model does not have: a reaction of the subject, a "
            "stiffness that changes with the stretch, a reflex of another kind, or a torque that is recorded late. End "
            "the windows earlier, compare smaller perturbations, or measure the lag."
        )
    if balance_p < UNBALANCED:
        warnings.append(
            "the conditions differ before the onset, so they are not at random: was the perturbation foreseen?"
        )
    if (
        solution.converged
        and not solution.parameters.passive
        and solution.reflex_score < CERTAIN_REFLEX
    ):
        warnings.append(
            f"G is {solution.reflex_score:.2g} times its standard error, and its interval is not symmetric below "
            f"{CERTAIN_REFLEX:g}: record more trials to say something of the reflex."
        )
    return warnings


def _find_reference(_: EnsembleOptions) -> str:
    """What the instruments are made of, whatever the options."""
    return "condition"


METHODS = (
    Method(
        "ensemble",
        EnsembleOptions,
        identify_ensemble,
        reference=_find_reference,
        merges=True,
        validity=Validity(closed={}),
        prepare=prepare_windows,
        check=check_windows,
    ),
)
