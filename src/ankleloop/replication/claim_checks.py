"""How each claim of the paper is judged: a comparison of results, and its reason in a sentence."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from ankleloop.signals.vaf import confidence_margin

__all__ = ["JUDGES", "CannotBeJudged", "Judgement", "table_number"]

ONE_PASS, CONVERGED = "parallel-cascade-one-pass", "parallel-cascade"
OPEN_LOOP_METHODS = ("pi-moesp", "po-moesp", CONVERGED, "real-time")


class CannotBeJudged(Exception):
    """What the claim needs is not there."""


@dataclass(frozen=True)
class Judgement:
    """Outcome of a comparison: whether the claim holds (None if that cannot be said), the number, and why."""

    holds: bool | None
    ours: float
    uncertainty: float
    reason: str


@dataclass(frozen=True)
class Mean:
    """Mean over trials with half of its 95 % interval."""

    value: float
    margin: float

    @property
    def text(self):
        """The mean and its interval in words."""
        return f"{self.value:.4g} ± {self.margin:.2g}"


TOO_WIDE = "the 95 % interval is too wide to tell"


def _within(difference, margin, tolerance):
    """Whether a difference is within a tolerance; None where its interval is wider than the tolerance and open."""
    size = abs(difference)
    if np.nan_to_num(margin, nan=np.inf) <= tolerance or size + margin <= tolerance:
        return bool(size <= tolerance)
    return False if size - margin > tolerance else None


def _larger(difference, margin, smallest):
    """Whether a difference is above 0 and large enough to count; None where its interval leaves that open."""
    if difference > margin and difference >= smallest:
        return True
    return False if difference + margin < smallest else None


def _all(verdicts):
    """False if any is, else None if any is open."""
    return False if False in verdicts else None if None in verdicts else True


def _study(evidence, name):
    if name not in evidence["studies"]:
        raise CannotBeJudged(f"the study {name} was not run.")
    return evidence["studies"][name]


def _mean(table, column, point, method, **where):
    rows = table[(table["point"] == point) & (table["method"] == method)]
    for name, value in where.items():
        rows = rows[rows[name] == value]
    if rows.empty:
        wanted = ", ".join(f"{name} {value}" for name, value in where.items())
        raise CannotBeJudged(f"there are no results of {method} at {point}" + (f" ({wanted})." if wanted else "."))
    values = rows[column]
    return Mean(float(values.mean()), float(confidence_margin(values.std(), values.size)))


def _vaf(study, point, method, torque, against="true"):
    return _mean(study.scores, "vaf", point, method, torque=torque, against=against)


def _difference(study, point, methods, torque, against):
    """Mean difference of the VAF of two methods on the same trials."""
    rows = study.scores[
        (study.scores["point"] == point) & (study.scores["torque"] == torque) & (study.scores["against"] == against)
    ]
    by_trial = rows.pivot(index="trial", columns="method", values="vaf")
    if not set(methods) <= set(by_trial):
        raise CannotBeJudged(f"there are no results of {' and '.join(methods)} at {point}.")
    values = by_trial[methods[0]] - by_trial[methods[1]]
    return Mean(float(values.mean()), float(confidence_margin(values.std(), values.size)))


def _error_of_k(study, point, method):
    """Mean error of K [% of the true K]."""
    truth = study.points[point]["stiffness"]
    k = _mean(study.parameters, "K", point, method)
    return Mean(100 * (k.value / truth - 1), 100 * k.margin / truth)


def _points(study, **where):
    """Points at which parameters have given values, in the order of the study."""
    return [
        name for name, given in study.points.items() if all(given.get(key) == value for key, value in where.items())
    ]


def _one_point(study, name, **where):
    found = _points(study, **where)
    if not found:
        wanted = ", ".join(f"{key} = {value}" for key, value in where.items())
        raise CannotBeJudged(f"the study {name} has no point with {wanted}.")
    return found[0]


def table_number(claim, evidence):
    """A number of a table: the mean over trials at the first point of the study that stands for it."""
    study = _study(evidence, claim["study"])
    point = next(iter(study.points))
    ours = _vaf(study, point, claim["method"], claim["torque"], claim["against"])
    difference = ours.value - claim["paper"]
    if claim["study"] == "table2" and study.kind == "simulation":
        reason = f"the recording is not public; a simulated stand-in gives {ours.text} %."
        return Judgement(None, ours.value, ours.margin, reason)
    holds = _within(difference, ours.margin, claim["tolerance"])
    side = "above" if difference > 0 else "below"
    reason = f"ours is {abs(difference):.1f} points {side} the paper's {claim['paper']:g} % at {_readable(point)}"
    if holds is None:
        reason += f" ± {ours.margin:.2g}: {TOO_WIDE}"
    elif not holds:
        reason += f", more than {claim['tolerance']:g} points" + (": better than published" if difference > 0 else "")
    return Judgement(holds, ours.value, ours.margin, reason + ".")


def _readable(point):
    return point.replace("=", " ").replace("_", " ").replace(",", ", ").removesuffix(".0")


def _strong_voluntary(study, closed_loop, level=0.5):
    return _one_point(study, "voluntary", voluntary=level, closed_loop=closed_loop)


def open_loop_methods_biased(claim, evidence):
    """K in closed loop is off the truth for every method that was made for open loop."""
    study = _study(evidence, "voluntary")
    told, closed_errors, verdicts = [], [], []
    for method in OPEN_LOOP_METHODS:
        closed, free = (_error_of_k(study, _strong_voluntary(study, loop), method) for loop in (True, False))
        verdicts.append(_larger(abs(closed.value), closed.margin, claim["tolerance"]))
        remark = {True: "", False: ": not biased", None: f": {TOO_WIDE}"}[verdicts[-1]]
        if _larger(abs(free.value), free.margin, claim["tolerance"]):
            remark += ": biased in open loop, too"
        told.append(
            f"{study.labels.get(method, method)} {closed.value:+.0f} ± {closed.margin:.0f} % "
            f"(open loop {free.value:+.0f} ± {free.margin:.0f} %){remark}"
        )
        closed_errors.append(closed)
    least = min(closed_errors, key=lambda mean: abs(mean.value))
    reason = f"error of K in closed loop: {'; '.join(told)}."
    return Judgement(_all(verdicts), least.value, least.margin, reason)


def _unbiased(claim, evidence, method):
    study = _study(evidence, "voluntary")
    errors = {study.points[p]["voluntary"]: _error_of_k(study, p, method) for p in _points(study, closed_loop=True)}
    if not errors:
        raise CannotBeJudged("the study voluntary has no closed-loop points.")
    worst = max(errors.values(), key=lambda error: abs(error.value))
    holds = _all([_within(error.value, error.margin, claim["tolerance"]) for error in errors.values()])
    said = ", ".join(f"{error.value:+.1f} ± {error.margin:.1f} % at {100 * v:g} %" for v, error in errors.items())
    reason = f"error of K against voluntary torque: {said}."
    if holds is None:
        reason = reason.rstrip(".") + f": {TOO_WIDE}."
    elif not holds:
        reason += " Torque that is fed back biases B and D by least squares, whatever the instruments of A and C are."
    return Judgement(holds, worst.value, worst.margin, reason)


def eiv_unbiased(claim, evidence):
    """EIV-MOESP finds K in closed loop at every level of voluntary torque."""
    return _unbiased(claim, evidence, "eiv-moesp")


def pr_unbiased(claim, evidence):
    """PR-MOESP finds K in closed loop at every level of voluntary torque."""
    return _unbiased(claim, evidence, "pr-moesp")


def pr_accurate(claim, evidence):
    """PR-MOESP finds K at the setting of Table 1."""
    study = _study(evidence, "table1")
    error = _error_of_k(study, next(iter(study.points)), "pr-moesp")
    reason = f"error of K: {error.value:+.2f} ± {error.margin:.2f} %."
    return Judgement(_within(error.value, error.margin, claim["tolerance"]), error.value, error.margin, reason)


def similar(claim, evidence):
    """PR-MOESP and EIV-MOESP differ little in Table 1."""
    study = _study(evidence, "table1")
    point = next(iter(study.points))
    differences = {
        torque: _difference(study, point, ("pr-moesp", "eiv-moesp"), torque, against)
        for torque, against in (("net", "measured"), ("intrinsic", "true"), ("reflex", "true"))
    }
    worst = max(differences.values(), key=lambda difference: abs(difference.value))
    holds = _all([_within(one.value, one.margin, claim["tolerance"]) for one in differences.values()])
    said = ", ".join(f"{torque} {one.value:+.1f} ± {one.margin:.1f}" for torque, one in differences.items())
    reason = f"PR-MOESP less EIV-MOESP: {said} points of VAF" + (f": {TOO_WIDE}." if holds is None else ".")
    return Judgement(holds, worst.value, worst.margin, reason)


def cascade_net_good(claim, evidence):
    """One pass of the parallel cascade: a good net torque from poor parts."""
    study = _study(evidence, "table1")
    point = next(iter(study.points))
    net, part = (_vaf(study, point, ONE_PASS, *which) for which in (("net", "measured"), ("intrinsic", "true")))
    holds = abs(net.value - claim["paper"]) <= claim["tolerance"] and net.value - part.value > 20
    return Judgement(holds, net.value, net.margin, f"net VAF {net.text} %, intrinsic VAF {part.text} %.")


def cascade_better_in_open_loop(claim, evidence):
    """One pass finds the intrinsic torque better in open loop."""
    study = _study(evidence, "voluntary")
    free, closed = (
        _vaf(study, _one_point(study, "voluntary", voluntary=0.0, closed_loop=loop), ONE_PASS, "intrinsic")
        for loop in (False, True)
    )
    difference, margin = free.value - closed.value, float(np.hypot(free.margin, closed.margin))
    reason = f"intrinsic VAF {free.text} % in open loop, {closed.text} % in closed loop."
    return Judgement(_larger(difference, margin, claim["tolerance"]), difference, margin, reason)


def _gains(study):
    """Points of Figure 4 by reflex gain."""
    return dict(sorted((given["reflex_gain"], point) for point, given in study.points.items()))


def figure4_pr(claim, evidence):
    """PR-MOESP is good at every gain."""
    study = _study(evidence, "figure4")
    found = {
        (gain, torque): _vaf(study, point, "pr-moesp", torque)
        for gain, point in _gains(study).items()
        for torque in ("net", "intrinsic", "reflex")
    }
    (gain, torque), lowest = min(found.items(), key=lambda item: item[1].value)
    reason = f"the lowest mean VAF is {lowest.text} % ({torque} torque at gain {gain:g})."
    return Judgement(lowest.value >= claim["paper"], lowest.value, lowest.margin, reason)


def figure4_cascade_biased(claim, evidence):
    """One pass of the parallel cascade misses the intrinsic torque at the highest gain."""
    study = _study(evidence, "figure4")
    gains = _gains(study)
    first, last = (_vaf(study, gains[gain], ONE_PASS, "intrinsic") for gain in (min(gains), max(gains)))
    reason = f"intrinsic VAF {first.text} % at gain {min(gains):g}, {last.text} % at gain {max(gains):g}."
    return Judgement(last.value + last.margin < claim["paper"], last.value, last.margin, reason)


def figure4_cascade_falls(claim, evidence):
    """One pass of the parallel cascade falls with the gain."""
    study = _study(evidence, "figure4")
    gains = _gains(study)
    if len(gains) < 3:
        raise CannotBeJudged("the study figure4 has fewer than three gains.")
    means = [_vaf(study, point, ONE_PASS, "intrinsic").value for point in gains.values()]
    correlation = float(stats.spearmanr(list(gains), means).statistic)
    reason = f"rank correlation {correlation:.2f} over {len(gains)} gains, from {means[0]:.1f} to {means[-1]:.1f} %."
    return Judgement(abs(correlation - claim["paper"]) <= claim["tolerance"], correlation, np.nan, reason)


def figure4_cause(claim, evidence):
    """The converged parallel cascade on the same closed-loop trials is biased, too."""
    study = _study(evidence, "figure4")
    gains = _gains(study)
    highest = max(gains)
    ours = _vaf(study, gains[highest], CONVERGED, "intrinsic")
    passes = _mean(study.parameters, "passes", gains[highest], CONVERGED)
    holds = ours.value + ours.margin < 99
    reason = f"after {passes.value:.0f} passes on average at gain {highest:g} the intrinsic VAF is {ours.text} %"
    if not holds:
        reason += ": the published bias is that of an iteration that was stopped early, not that of the loop"
    return Judgement(holds, ours.value, ours.margin, reason + ".")


def figure4_count(claim, evidence):
    """Number of gains from 10 to 30 in steps of 1."""
    count = len(np.arange(10, 30 + 1, 1))
    return Judgement(count == claim["paper"], count, np.nan, f"gains from 10 to 30 in steps of 1 are {count}.")


def eq17_gain(claim, evidence):
    """Table 1 with the gain of Eq. 17 as printed."""
    study = _study(evidence, "table1")
    printed = _one_point(study, "table1", reflex_gain=2.0)
    ours = _vaf(study, printed, ONE_PASS, "intrinsic")
    assumed = next(iter(study.points))
    other = _vaf(study, assumed, ONE_PASS, "intrinsic")
    reason = (
        f"with a gain of 2 one pass of the parallel cascade finds {ours.text} % of the intrinsic torque, where Table 1 "
        f"has {claim['paper']:g} %; at {_readable(assumed)} it finds {other.text} %."
    )
    return Judgement(abs(ours.value - claim["paper"]) <= claim["tolerance"], ours.value, ours.margin, reason)


def _measured(evidence, *names):
    missing = [name for name in names if name not in evidence["measured"]]
    if missing:
        raise CannotBeJudged(f"{missing[0]} was not measured.")
    return [evidence["measured"][name] for name in names]


def eq10_constant(claim, evidence):
    """Directions that a constant among the inputs adds."""
    added, rows = _measured(evidence, "constant_directions", "constant_rows")
    reason = (
        f"its {rows:g} Hankel rows are all alike and add {added:g} directions once means are removed: it is left out, "
        "and a fifth-order basis is T1 … T5 in the usual numbering, five inputs."
    )
    return Judgement(added == claim["paper"], added, np.nan, reason)


def eq11_zero(claim, evidence):
    """What a free B gains in net VAF."""
    (gain,) = _measured(evidence, "free_b_net_vaf")
    reason = f"leaving B free changes the net VAF by {gain:+.2f} points."
    return Judgement(gain <= claim["tolerance"], gain, np.nan, reason)


def _columns(claim, evidence, method):
    rows, block_rows = _measured(evidence, f"{method}_instrument_rows", "block_rows")
    return rows, block_rows, rows / block_rows == claim["paper"]


def columns_eiv(claim, evidence):
    """Columns of instruments of EIV-MOESP."""
    rows, block_rows, holds = _columns(claim, evidence, "eiv-moesp")
    reason = f"{rows:g} rows of instruments over {block_rows:g} block rows: 3 + 5 inputs and 1 output."
    return Judgement(holds, rows / block_rows, np.nan, reason)


def columns_pr(claim, evidence):
    """Columns of instruments of PR-MOESP."""
    rows, block_rows, holds = _columns(claim, evidence, "pr-moesp")
    (needed,) = _measured(evidence, "correlation_rows")
    reason = (
        f"{rows:g} rows of instruments over {block_rows:g} block rows in the ordinary form; the correlation form, "
        f"which is consistent in closed loop, needs {needed:g} rows."
    )
    return Judgement(holds, rows / block_rows, np.nan, reason)


def _ratio(claim, evidence, quantity, unit):
    pr, eiv = _measured(evidence, f"pr-moesp_{quantity}", f"eiv-moesp_{quantity}")
    reason = f"PR-MOESP {pr:.3g} {unit}, EIV-MOESP {eiv:.3g} {unit}."
    return Judgement(eiv / pr > claim["paper"], eiv / pr, np.nan, reason)


def economy_time(claim, evidence):
    """Time of EIV-MOESP over that of PR-MOESP."""
    return _ratio(claim, evidence, "milliseconds", "ms")


def economy_memory(claim, evidence):
    """Peak memory of EIV-MOESP over that of PR-MOESP."""
    return _ratio(claim, evidence, "megabytes", "MB")


def table2_text(claim, evidence):
    """Numbers of Table 2 against those of the text."""
    table = evidence["tables"]["table2"].dropna(subset="text")
    difference = (table["paper"] - table["text"]).abs()
    told = [f"{row.torque} {row.paper:g} % and {row.text:g} %" for row in table[difference > 0].itertuples()]
    reason = f"table and text differ for the parallel cascade: {', '.join(told)}." if told else "they agree."
    return Judgement(float(difference.max()) <= claim["tolerance"], float(difference.max()), np.nan, reason)


def real_time_input(claim, evidence):
    """Error of K of the real-time algorithm with either perturbation in open loop."""
    study = _study(evidence, "real-time")
    pulses, prbs = (
        _error_of_k(study, _one_point(study, "real-time", perturbation=name, closed_loop=False), "real-time")
        for name in ("pulses", "prbs")
    )
    difference, margin = abs(prbs.value) - abs(pulses.value), float(np.hypot(prbs.margin, pulses.margin))
    holds = _larger(difference, margin, claim["tolerance"])
    said = [f"{error.value:+.1f} ± {error.margin:.1f} %" for error in (pulses, prbs)]
    reason = f"error of K: {said[0]} with it, {said[1]} with a PRBS."
    return Judgement(holds, pulses.value, pulses.margin, reason)


JUDGES = {
    judge.__name__: judge
    for judge in (
        open_loop_methods_biased,
        eiv_unbiased,
        pr_accurate,
        pr_unbiased,
        similar,
        cascade_net_good,
        cascade_better_in_open_loop,
        figure4_pr,
        figure4_cascade_biased,
        figure4_cascade_falls,
        figure4_cause,
        figure4_count,
        eq17_gain,
        eq10_constant,
        eq11_zero,
        columns_eiv,
        columns_pr,
        economy_time,
        economy_memory,
        table2_text,
        real_time_input,
    )
}
