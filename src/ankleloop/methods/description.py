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
    "ensemble": (
        "instrumental variables from the conditions of short windows",
        "Angrist, Imbens and Krueger 1999",
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
    "influence of trials": "from the influence of each trial",
    "between trials": "from the scatter between the trials, for the mean over all such trials",
}
LISTED = 6  # values of an option that are told


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
    duration = f"{estimate.torque.sizes['time'] / rate:.0f} s after filters"
    if estimate.conditions:
        counts = [f"{count} of {name}" for name, count in estimate.conditions.items()]
        start, end = (1000 * time for time in diagnostics["window"])
        records = f"{sum(estimate.conditions.values())} trials ({', '.join(counts)})"
        duration = f"{start:.0f} to {end:.0f} ms from the onset"
    has_reflex = bool(estimate.torque["reflex"].any())
    paths = "Intrinsic and reflex stiffness were" if has_reflex else "Intrinsic stiffness was"
    sentences = [
        f"{paths} estimated by {method} from {records}, {duration}, at {rate:g} Hz.",
    ]
    if has_reflex:
        delay = "estimated" if "delay" in estimate.intervals else "assumed"
        sentences.append(
            f"The reflex delay was {delay} ({1000 * estimate.reflex['delay']:.0f} ms)."
        )
    if estimate.conditions:
        sentences.append("The instrument was the condition, what was commanded in each trial.")
    elif "reference" in diagnostics:
        sentences.append(f"Instruments were made of the variable {diagnostics['reference']}.")
    if estimate.apparatus:
        sentences.append(f"Torque and parameters are {estimate.apparatus}.")
    kind = diagnostics.get("intervals")
    if kind in INTERVALS:
        sentences.append(f"Intervals (95 %) are {INTERVALS[kind]}.")
    options = diagnostics.get("options", {})
    if options:
        listed = ", ".join(f"{name} = {_describe_value(value)}" for name, value in options.items())
        sentences.append(f"Options other than the defaults: {listed}.")
    sentences.append(f"Software: ankleloop {version('ankleloop')}.")
    return " ".join(sentences)


def _describe_value(value: object) -> str:
    """A value of an option; of a long list, as that of onsets, how many it has."""
    if isinstance(value, (list, tuple)) and len(value) > LISTED:
        return f"{len(value)} values"
    return str(value)
