"""Pictures of one recording: what was checked, the models, what they leave; and of a group of recordings."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.plotting.style import COLOURS, STYLE, add_legend

__all__ = ["group_figure", "model_figure", "residual_figure", "spectra_figure"]

UNITS = {
    "K": "N·m/rad",
    "B": "N·m·s/rad",
    "I": "kg·m²",
    "G": "N·m·s/rad",
    "omega_n": "rad/s",
    "zeta": "1",
    "delay": "s",
    "vaf_unseen": "%",
}
SYMBOLS = {"omega_n": "ωn", "zeta": "ζ", "delay": "delay", "vaf_unseen": "net VAF, unseen half"}
LONGEST = 0.4  # s of impulse responses


def spectra_figure(spectra):
    """Power spectra of position and torque, and their coherence.

    Parameters
    ----------
    spectra : dict of str to ndarray
        As `ankleloop.recordings.checks.Check` has them.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.6), layout="constrained")
        axes = figure.subplots(1, 3)
        frequency = spectra["frequency"]
        for axis, (name, unit) in zip(axes, (("position", "rad²/Hz"), ("torque", "(N·m)²/Hz")), strict=False):
            axis.loglog(frequency, spectra[name], color=COLOURS[0], lw=1.0)
            axis.set_ylabel(f"{name} [{unit}]")
        axes[2].semilogx(frequency, spectra["coherence"], color=COLOURS[0], lw=1.0, label="position and torque")
        if "reference_coherence" in spectra:
            axes[2].semilogx(
                frequency, spectra["reference_coherence"], color=COLOURS[1], lw=1.0, label="reference and position"
            )
        axes[2].set(ylabel="squared coherence [1]", ylim=(0, 1.02))
        for axis in axes:
            axis.set_xlabel("frequency [Hz]")
            axis.xaxis.set_major_formatter("{x:g}")
        add_legend(figure, axes[2:])
    return figure


def model_figure(estimates):
    """What the models are like: impulse responses, Bode magnitudes, and the nonlinearity of the reflex.

    Parameters
    ----------
    estimates : dict of str to Estimate
        Estimates by the label of the method.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 5.0), layout="constrained")
        (intrinsic, intrinsic_gain, curve), (reflex, reflex_gain, phase) = figure.subplots(2, 3)
        free = any("intrinsic_response" in estimate.diagnostics for estimate in estimates.values())
        for number, (label, estimate) in enumerate(estimates.items()):
            look = {"color": COLOURS[number % len(COLOURS)], "lw": 1.1, "label": label}
            _intrinsic(intrinsic if free else None, intrinsic_gain, None if free else intrinsic, estimate, look)
            _reflex(reflex, reflex_gain, phase, estimate, look)
            shape = estimate.diagnostics.get("nonlinearity")
            if shape is not None:
                curve.plot(shape["velocity"], shape["torque"], **look)
        if free:
            intrinsic.set(xlabel="time [s]", ylabel="intrinsic response [N·m/rad]", title="per sample, two-sided")
        else:
            intrinsic.set(xlabel="frequency [Hz]", ylabel="intrinsic phase [°]")
        intrinsic_gain.set(xlabel="frequency [Hz]", ylabel="intrinsic gain [N·m/rad]")
        curve.set(xlabel="delayed velocity [rad/s]", ylabel="nonlinearity [N·m]")
        reflex.set(xlabel="time after the delay [s]", ylabel="reflex response [1/s]", title="of unit gain")
        reflex_gain.set(xlabel="frequency [Hz]", ylabel="reflex gain over that at rest [1]")
        phase.set(xlabel="frequency [Hz]", ylabel="reflex phase without delay [°]")
        for axis in (intrinsic_gain, reflex_gain, phase):
            axis.xaxis.set_major_formatter("{x:g}")
        add_legend(figure, (intrinsic_gain, curve, reflex))
    return figure


FREQUENCY = np.geomspace(0.2, 38.0, 200)


def _intrinsic(response, gain, phase, estimate, look):
    """Two-sided response where the method has one; gain of the second-order model, and its phase if there is room."""
    if response is not None and "intrinsic_response" in estimate.diagnostics:
        response.plot(
            estimate.diagnostics["intrinsic_lags"], estimate.diagnostics["intrinsic_response"], "o-", ms=2, **look
        )
    s = 2j * np.pi * FREQUENCY
    K, B, I = (estimate.stiffness[name] for name in "KBI")  # noqa: E741 - the field's name
    gain.loglog(FREQUENCY, np.abs(K + B * s + I * s**2), **look)
    if phase is not None:
        phase.semilogx(FREQUENCY, np.degrees(np.unwrap(np.angle(K + B * s + I * s**2))), **look)
        phase.xaxis.set_major_formatter("{x:g}")


def _reflex(response, gain, phase, estimate, look):
    """Low-pass of the reflex, and the free response of a method that has one."""
    values = estimate.reflex
    if "omega_n" not in values:
        return
    dynamics = ReflexDynamics(values["omega_n"], values["zeta"], values.get("pole"))
    time = np.arange(0.0, LONGEST, 1e-3)
    edges = 2j * np.pi * np.fft.rfftfreq(4096, 1e-3)
    response.plot(time, np.fft.irfft(dynamics.response(edges)[0])[: time.size] * 1e3, **look)
    if "reflex_response" in estimate.diagnostics:
        lags = np.asarray(estimate.diagnostics["reflex_lags"])
        free = np.asarray(estimate.diagnostics["reflex_response"]) / values["G"] / (lags[1] - lags[0])
        response.plot(lags[lags < LONGEST], free[lags < LONGEST], ".", ms=2.5, color=look["color"])
    shape = dynamics.response(2j * np.pi * FREQUENCY)[0]
    gain.loglog(FREQUENCY, np.abs(shape), **look)
    phase.semilogx(FREQUENCY, np.degrees(np.unwrap(np.angle(shape))), **look)


def residual_figure(tests):
    """What the models leave: spectra, and correlation with what must not explain it.

    Parameters
    ----------
    tests : dict of str to ResidualTest
        Tests by the label of the method.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.9), layout="constrained")
        density, correlation = figure.subplots(1, 2)
        for number, (label, test) in enumerate(tests.items()):
            look = {"color": COLOURS[number % len(COLOURS)], "lw": 1.0, "label": label}
            density.loglog(test.frequency, test.density, **look)
            correlation.plot(test.lags, test.correlation, **look)
        limit = next(iter(tests.values())).limit
        for sign in (-1.0, 1.0):
            correlation.axhline(sign * limit, color="black", lw=0.8, ls=(0, (2, 2)), label="99 % of unrelated ones")
        density.set(xlabel="frequency [Hz]", ylabel="residual torque [(N·m)²/Hz]")
        density.xaxis.set_major_formatter("{x:g}")
        correlation.set(xlabel="time by which the residual is behind [s]", ylabel="whitened correlation [1]")
        add_legend(figure, (density, correlation))
    return figure


def group_figure(table, names, *, condition="condition", subject="subject"):
    """Parameters against the condition: a point for each recording, a line for the mean of each subject.

    Parameters
    ----------
    table : pandas.DataFrame
        One row for each recording and method: `condition`, `subject`, `label`, and the parameters.
    names : sequence of str
        Parameters, a row of panels each; a column for each method.
    condition, subject : str
        Columns.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        labels, conditions = list(dict.fromkeys(table["label"])), list(dict.fromkeys(table[condition]))
        subjects = list(dict.fromkeys(table[subject]))
        size = (max(2.6, 0.5 * len(conditions) + 1.6) * len(labels) + 0.6, 1.7 * len(names) + 0.9)
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(len(names), len(labels), squeeze=False, sharex=True, sharey="row")
        for column, label in enumerate(labels):
            for axis, name in zip(axes[:, column], names, strict=True):
                for number, who in enumerate(subjects):
                    part = table[(table["label"] == label) & (table[subject] == who)].dropna(subset=[name])
                    _points(axis, part, name, condition, conditions, number, len(subjects), who)
                axis.set_xticks(range(len(conditions)), conditions)
                axis.margins(x=0.15)
            axes[0, column].set_title(label)
            axes[-1, column].set_xlabel(condition)
        for axis, name in zip(axes[:, 0], names, strict=True):
            axis.set_ylabel(f"{SYMBOLS.get(name, name)} [{UNITS[name]}]")
        if len(subjects) <= len(COLOURS):
            add_legend(figure, axes.flat)
    return figure


def _points(axis, part, name, condition, conditions, number, count, who):
    colour = COLOURS[number % len(COLOURS)]
    place = part[condition].map(conditions.index).astype(float)
    aside = 0.24 * ((number + 0.5) / count - 0.5)
    axis.plot(place + aside, part[name], "o", ms=2.6, mfc="none", color=colour, alpha=0.8)
    means = part.groupby(condition, sort=False)[name].mean()
    where = [conditions.index(value) for value in means.index]
    order = np.argsort(where)
    axis.plot(np.array(where)[order] + aside, means.to_numpy()[order], "-", lw=1.0, color=colour, label=str(who))
