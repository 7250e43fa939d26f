"""A paragraph for a paper: by which method, with which options, an estimate was made."""

from __future__ import annotations

from importlib.metadata import version

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.regressors import split_torques

# What a method is called in a sentence, and where it comes from.
SOURCES = {
    "riv": (
        "refined instrumental variables in continuous time",
        "Young 2011; Gilson, Garnier, Young and Van den Hof 2011",
    ),
    "riv-tv": (
        "refined instrumental variables with splines of the parameters",
        "Young 2011; Guarin and Kearney 2017",
    ),
    "pr-moesp": ("the subspace method PR-MOESP", "Zhao, Ludvig and Kearney 2008"),
    "eiv-moesp": ("the subspace method EIV-MOESP", "Chou and Verhaegen 1997"),
    "pi-moesp": ("the subspace method PI-MOESP", "Verhaegen 1993"),
    "po-moesp": ("the subspace method PO-MOESP", "Verhaegen 1994"),
    "moesp": ("the subspace method MOESP", "Verhaegen and Dewilde 1992"),
    "parallel-cascade": (
        "the parallel-cascade method",
        "Kearney, Stein and Parameswaran 1997",
    ),
    "real-time": ("the real-time algorithm", "Ludvig and Kearney 2006"),
    "apparatus": (
        "instrumental variables with Coulomb friction, as that of a device without a subject,",
        "Janot, Gautier and Brunot 2019",
    ),
}
INTERVALS = {
    "asymptotic": "from the asymptotic covariance",
    "robust": "robust against what the model lacks",
    "between trials": "from the scatter between the trials, for the mean over all such trials",
}


def describe_methods(estimate: Estimate) -> str:
    """A paragraph that says how an estimate was made."""
    diagnostics = estimate.diagnostics
    method = f"the method {estimate.method} of another package"
    if estimate.method in SOURCES:
        name, source = SOURCES[estimate.method]
        method = f"{name} ({source})"
    rate = estimate.torque.attrs["identification_rate"]
    trials = len(split_torques(estimate.torque))
    records = f"{trials} merged trials" if trials > 1 else "one trial"
    has_reflex = bool(estimate.torque["reflex"].any())
    paths = "Intrinsic and reflex stiffness were" if has_reflex else "Intrinsic stiffness was"
    sentences = [
        f"{paths} estimated by {method} from {records}, "
        f"{estimate.torque.sizes['time'] / rate:.0f} s after filters, at {rate:g} Hz.",
    ]
    if has_reflex:
        delay = "estimated" if "delay" in estimate.intervals else "assumed"
        sentences.append(
            f"The reflex delay was {delay} ({1000 * estimate.reflex['delay']:.0f} ms)."
        )
    if "reference" in diagnostics:
        sentences.append(f"Instruments were made of the variable {diagnostics['reference']}.")
    if estimate.apparatus:
        sentences.append(f"Torque and parameters are {estimate.apparatus}.")
    kind = diagnostics.get("intervals")
    if kind in INTERVALS:
        sentences.append(f"Intervals (95 %) are {INTERVALS[kind]}.")
    options = diagnostics.get("options", {})
    if options:
        listed = ", ".join(f"{option} = {value}" for option, value in options.items())
        sentences.append(f"Options other than the defaults: {listed}.")
    sentences.append(f"Software: ankleloop {version('ankleloop')}.")
    return " ".join(sentences)
