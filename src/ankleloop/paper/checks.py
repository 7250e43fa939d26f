"""How each number and claim of the paper is checked: with which results of a run it is compared.

Points of studies are found by the values of their settings. The rule that gives a verdict is in `judgement`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import yaml
from scipy import stats

from ankleloop.paper import judgement
from ankleloop.paper.captions import label_setting
from ankleloop.paper.judgement import Comparison, Mean, Measurement, Quantity, describe_result, half_interval, judge
from ankleloop.simulation.settings import SimulationSettings

# What Table 1 scores each torque against.
VAF_COLUMNS = {"net": "vaf_net_measured", "intrinsic": "vaf_intrinsic_true", "reflex": "vaf_reflex_true"}
ONE_PASS, CONVERGED = "parallel-cascade-one-pass", "parallel-cascade"
# Methods that were made for open loop with their studies. The real-time algorithm needs its own perturbation.
OPEN_LOOP_METHODS = {"pi-moesp": "voluntary", "po-moesp": "voluntary", CONVERGED: "voluntary", "real-time": "real-time"}
PULSES = {"perturbation": "pulses", "reflex_gain": 5.0}
# Methods by study that are PR-MOESP with one basis, as published otherwise.
CHEBYSHEV = {"table1": "pr-moesp", "projection": "ordinary", "obstacles": "pr-chebyshev"}
RECTIFIER = {"projection": "ordinary-rectifier", "obstacles": "pr-rectifier"}
REPLICATES = 2000  # of the bootstrap
MOST_RESULTS = 8  # of comparisons that a reason lists; of more it has the decisive one
NEARLY_ALL = 90.0  # % VAF: from here on what is left unexplained tells more than the VAF

Row = dict[str, Any]  # verdict, numbers and reason of a claim, by the columns of the ledger


class MissingEvidence(Exception):
    """A claim cannot be judged, because results that it needs do not exist."""


def parse_settings(text: Any) -> dict[str, list[Any]]:
    """Settings of the points that a claim needs, as its row in a table gives them."""
    settings: dict[str, list[Any]] = {}
    for part in text.split() if isinstance(text, str) else []:
        name, _, values = part.partition("=")
        if ":" in values:
            first, last, step = map(float, values.split(":"))
            settings[name] = [first + step * k for k in range(round((last - first) / step) + 1)]
        else:
            settings[name] = [yaml.safe_load(value) for value in values.split("|")]
    return settings


@dataclass(frozen=True)
class StudyResults:
    """Results of one study."""

    kind: str  # "simulation" or "recordings"
    points: Mapping[str, Mapping[str, Any]]  # simulation settings of each point
    table: pd.DataFrame  # its trials, as `ankleloop.paper.trial_tables.read_trial_table` reads them
    labels: Mapping[str, str] = field(default_factory=dict)  # readable name of each method
    name: str = ""  # name of the study, for messages

    def point(self, settings: Mapping[str, Any]) -> str:
        """Name of the point with some values of its settings.

        Of several such points, that with the defaults of the simulation in everything by which they differ: a further
        point of the study changes nothing.
        """
        points = [point for point, values in self.points.items() if settings.items() <= values.items()]
        if len(points) > 1:
            first, defaults = self.points[points[0]], SimulationSettings.defaults()
            varied = [name for name in first if any(self.points[point].get(name) != first[name] for point in points)]
            points = [point for point in points if all(self.points[point][name] == defaults[name] for name in varied)]
        if len(points) != 1:
            number = "several points" if points else "no point"
            condition = ", ".join(f"{label_setting(name)[0]} {value}" for name, value in settings.items())
            raise MissingEvidence(f"the study {self.name} has {number} with {condition or 'its settings'}.")
        return points[0]

    def values(self, column: str, method: str, settings: Mapping[str, Any]) -> pd.Series:
        """A column of the table in each trial, or `K_error` [%]; a failed trial has no VAF, and nan for a parameter."""
        point = self.point(settings)
        if column == "K_error":
            return 100.0 * (self.values("K", method, settings) / self.points[point]["stiffness"] - 1.0)
        rows = self.table[(self.table["point"] == point) & (self.table["method"] == method)].set_index("trial")
        values = rows.reindex(columns=[column])[column].astype(float)
        values = values.dropna() if column.startswith("vaf_") else values
        if values.empty:
            raise MissingEvidence(f"the study {self.name} has no {column} of {method} at {point}.")
        return values


@dataclass(frozen=True)
class Case:
    """A claim with everything that claims are checked against."""

    claim: Mapping[str, Any]  # a row of the claims, or a number of a published table
    studies: Mapping[str, StudyResults]  # results by study
    # Further measurements by `quantity`: columns `value`, `low` and `high`, the ends of the 95 % interval.
    measurements: pd.DataFrame
    tables: Mapping[str, pd.DataFrame]  # published tables

    @property
    def paper(self) -> float:
        """What the paper says."""
        return self.claim["paper"]

    @property
    def tolerance(self) -> float:
        """Difference that is accepted; nan where nothing says so."""
        return self.claim.get("tolerance", np.nan)

    def levels(self, name: str) -> list[Any]:
        """Values of a setting at the points that the claim needs."""
        return parse_settings(self.claim["settings"])[name]

    def study(self, name: str) -> StudyResults:
        """Results of a study."""
        if name not in self.studies:
            raise MissingEvidence(f"the study {name} was not run.")
        return self.studies[name]

    def values(self, study: str, column: str, method: str, **own: Any) -> pd.Series:
        """A column of a study in each trial, at the settings of the claim and some of its own."""
        settings = {name: values[0] for name, values in parse_settings(self.claim.get("settings")).items()}
        return self.study(study).values(column, method, {**settings, **own})

    def vaf(self, study: str, method: str, torque: str, **own: Any) -> Mean:
        """Mean VAF of a torque [%]."""
        return Mean.of(self.values(study, VAF_COLUMNS[torque], method, **own))

    def lead(self, study: str, first: tuple[str, str], second: tuple[str, str], **own: Any) -> Mean:
        """Mean VAF of a method and a torque less that of another on the same trials [points]; nan if these differ."""
        return Mean.of(
            self.values(study, VAF_COLUMNS[first[1]], first[0], **own)
            - self.values(study, VAF_COLUMNS[second[1]], second[0], **own)
        )

    def error(self, study: str, method: str, **own: Any) -> Mean:
        """Mean error of K [% of the true K]."""
        return Mean.of(self.values(study, "K_error", method, **own))

    def measurement(self, quantity: str) -> Measurement:
        """A further measurement with its interval."""
        if quantity not in self.measurements.index:
            raise MissingEvidence(f"{quantity} was not measured.")
        return Measurement(*self.measurements.reindex(columns=["value", "low", "high"]).loc[quantity].astype(float))

    def within(self, label: str, ours: Quantity, paper: float = 0.0, *, control: bool = False) -> Comparison:
        """A comparison that accepts differences of either sign up to the tolerance."""
        return Comparison(label, ours, (-self.tolerance, self.tolerance), paper, control=control)

    def above(self, label: str, ours: Quantity, paper: float = 0.0, *, size: bool = False) -> Comparison:
        """A comparison that accepts differences, or sizes of them, from the tolerance on."""
        return Comparison(label, ours, (self.tolerance, np.inf), paper, size=size)

    def below(self, label: str, ours: Quantity, paper: float = 0.0) -> Comparison:
        """A comparison that accepts what is less by the tolerance or more."""
        return Comparison(label, ours, (-np.inf, -self.tolerance), paper)

    def compare(
        self, what: str, comparisons: Sequence[Comparison], remark: str = "", ours: Quantity | None = None
    ) -> Row:
        """Verdict on the claim, which needs all comparisons, with the numbers that it rests on and its reason.

        Our value is that of the comparison that decides, if none is given.
        """
        judged = judge(comparisons)
        ours, decisive = ours or judged.decisive.ours, judged.decisive
        listed = comparisons if len(comparisons) <= MOST_RESULTS else [decisive]
        reason = f"{what}: {', '.join(map(_describe, listed))}"
        if len(listed) < len(comparisons):
            reason += f" (of {len(comparisons)} results the decisive one)"
        parts = [reason, remark, judged.explanation]
        has_condition = judged.verdict == judgement.REPRODUCED and isinstance(self.claim["conditions"], str)
        return {
            "verdict": judgement.CONDITIONAL if has_condition else judged.verdict,
            "ours": ours.value,
            "uncertainty": half_interval(ours),
            "difference": decisive.difference,
            **dict(zip(("difference_low", "difference_high"), judged.interval, strict=True)),
            "reason": "; ".join(part.rstrip(".") for part in parts if part) + ".",
        }


def _describe(comparison: Comparison) -> str:
    """A result in words; of a VAF near 100 % also what it leaves unexplained, since its difference says little."""
    ours, paper = comparison.ours.value, comparison.paper
    text = f"{comparison.label} {describe_result(comparison.ours)}".strip()
    if not (NEARLY_ALL <= paper < 100.0 and ours >= NEARLY_ALL):
        return text
    return f"{text} ({(100.0 - ours) / (100.0 - paper):.2g} times the unexplained variance of the paper)"


def state(value: float, expected: float, reason: str, *, otherwise: str = judgement.NOT_REPRODUCED) -> Row:
    """Verdict on what no run can change: a count in the paper, or what follows from a definition."""
    verdict = judgement.BY_CONSTRUCTION if value == expected else otherwise
    return {"verdict": verdict, "ours": value, "reason": f"{reason}."}


def check_table_number(case: Case) -> Row:
    """A number of a table is the mean over trials at the settings that the table names."""
    name, column = case.claim["study"], f"vaf_{case.claim['torque']}_{case.claim['against']}"
    comparison = case.within("", Mean.of(case.values(name, column, case.claim["method"])), case.paper)
    remark = "the table sets no tolerance" if np.isnan(case.tolerance) else ""
    if name == "table2" and case.study(name).kind == "simulation":
        remark = "the recording is not public, and this is a simulated stand-in"
    return case.compare("mean VAF [%]", [comparison], remark)


def check_alike(case: Case, first: str, second: str, torques: Sequence[str]) -> Row:
    """VAFs by two methods differ little, on the same trials."""
    labels = [case.study("table1").labels.get(method, method) for method in (first, second)]
    leads = {torque: case.lead("table1", (first, torque), (second, torque)) for torque in torques}
    comparisons = [case.within(torque, lead) for torque, lead in leads.items()]
    return case.compare(f"VAF by {labels[0]} less that by {labels[1]} [points]", comparisons)


def check_cascade_net_good(case: Case) -> Row:
    """One pass of the parallel cascade gives a good net torque from poor parts."""
    net = case.vaf("table1", ONE_PASS, "net")
    leads = {part: case.lead("table1", (ONE_PASS, "net"), (ONE_PASS, part)) for part in ("intrinsic", "reflex")}
    comparisons = [case.above(f"net less {part} torque", lead) for part, lead in leads.items()]
    comparisons.insert(0, case.within("net torque", net, case.paper))
    return case.compare("VAF [%]", comparisons, ours=net)


def check_cascade_better_in_open_loop(case: Case) -> Row:
    """One pass of the parallel cascade gives better torques of both paths in open loop."""
    comparisons = []
    for part in ("intrinsic", "reflex"):
        opened, closed = (case.vaf("voluntary", ONE_PASS, part, closed_loop=loop) for loop in (False, True))
        comparisons.append(case.above(f"{part} torque", opened - closed))
    return case.compare("VAF in open loop less that in closed loop [points]", comparisons)


def check_figure4_pr(case: Case) -> Row:
    """PR-MOESP is good at every gain."""
    comparisons = [
        case.above(
            f"{torque} torque at gain {gain:g}", case.vaf("figure4", "pr-moesp", torque, reflex_gain=gain), case.paper
        )
        for gain in case.levels("reflex_gain")
        for torque in VAF_COLUMNS
    ]
    return case.compare("mean VAF [%]", comparisons)


def check_figure4_cascade_biased(case: Case) -> Row:
    """The intrinsic torque by one pass of the parallel cascade is wrong at every gain, most of all at the highest."""
    gains = sorted(case.levels("reflex_gain"))
    means = {gain: case.vaf("figure4", ONE_PASS, "intrinsic", reflex_gain=gain) for gain in gains}
    comparisons = [case.below(f"gain {gain:g}", mean, 100.0) for gain, mean in means.items()]
    fall = case.below("highest gain less lowest", means[gains[-1]] - means[gains[0]])
    return case.compare("intrinsic VAF [%]", [*comparisons, fall])


def check_figure4_cascade_falls(case: Case) -> Row:
    """The intrinsic VAF of one pass of the parallel cascade falls with the gain: rank correlation with its interval."""
    gains, column = sorted(case.levels("reflex_gain")), VAF_COLUMNS["intrinsic"]
    trials = {gain: case.values("figure4", column, ONE_PASS, reflex_gain=gain).to_numpy() for gain in gains}
    remark = f"from {trials[gains[0]].mean():.1f} to {trials[gains[-1]].mean():.1f} % over {len(gains)} gains"
    comparison = case.within("", bootstrap_rank_correlation(trials), case.paper)
    return case.compare("rank correlation of gain and intrinsic VAF", [comparison], remark)


def bootstrap_rank_correlation(trials: Mapping[float, np.ndarray]) -> Measurement:
    """Spearman's rank correlation of gains with their means over trials, and its interval by bootstrap.

    The percentile interval is extended to the correlation itself. Means of samples drawn from trials have the noise of
    the trials twice, and a rank correlation suffers from noise: its replicates may all be closer to zero than itself.
    They show then that it is uncertain, and not that it is wrong.
    """
    gains, rng = list(trials), np.random.default_rng(0)
    value = float(_rank_correlation(gains, np.array([[values.mean() for values in trials.values()]]))[0])
    if min(values.size for values in trials.values()) < 2:
        return Measurement(value)
    draws = (values[rng.integers(values.size, size=(REPLICATES, values.size))] for values in trials.values())
    replicates = _rank_correlation(gains, np.column_stack([draw.mean(axis=1) for draw in draws]))
    low, high = np.quantile(replicates, [(1 - judgement.LEVEL) / 2, (1 + judgement.LEVEL) / 2])
    return Measurement(value, float(min(low, value)), float(max(high, value)))


def _rank_correlation(gains: Sequence[float], means: np.ndarray) -> np.ndarray:
    """Spearman's rank correlation of the gains with each row of means; nan where all of them are equal."""
    with np.errstate(invalid="ignore"):
        return np.corrcoef(stats.rankdata(gains), stats.rankdata(means, axis=-1))[0, 1:]


def check_figure4_cause(case: Case) -> Row:
    """The converged parallel cascade is biased on the same closed-loop trials, too."""
    first, last = (case.vaf("figure4", method, "intrinsic") for method in (ONE_PASS, CONVERGED))
    passes = case.values("figure4", "passes", CONVERGED).mean()
    remark = f"after {passes:.0f} passes on average; {first.value:.4g} % after one pass on the same closed-loop trials"
    return case.compare("intrinsic VAF of the converged cascade [%]", [case.below("", last, 100.0)], remark)


def check_figure4_count(case: Case) -> Row:
    """Number of gains from 10 to 30 in steps of 1."""
    count = len(case.levels("reflex_gain"))
    return state(count, case.paper, f"gains from 10 to 30 in steps of 1 are {count}", otherwise=judgement.CONTRADICTION)


def check_eq17_gain(case: Case) -> Row:
    """Table 1 with the gain of Eq. 17 as printed."""
    comparison = case.within("", case.vaf("table1", ONE_PASS, "intrinsic"), case.paper)
    return case.compare("intrinsic VAF of one pass with a gain of 2 [%]", [comparison])


def check_eq10_constant(case: Case) -> Row:
    """Directions that a constant among the inputs adds: none, whatever the data, because means are removed."""
    directions, rows = (case.measurement(f"constant_{name}").value for name in ("directions", "rows"))
    reason = (
        f"its {rows:g} Hankel rows are all alike and add {directions:g} directions once means are removed, so no "
        "result depends on it: it is left out, and a fifth-order basis is T1 … T5 in the usual numbering, five inputs"
    )
    return state(directions, case.tolerance, reason)


def check_columns(case: Case, method: str, text: str) -> Row:
    """Columns of instruments, which follow from the definition of a method."""
    names = (f"{method}_instrument_rows", "block_rows", "correlation_rows")
    rows, block_rows, correlation_rows = (case.measurement(name).value for name in names)
    reason = f"{rows:g} rows of instruments over {block_rows:g} block rows: {text.format(correlation_rows)}"
    return state(rows / block_rows, case.paper, reason)


def check_economy(case: Case, quantity: str, unit: str) -> Row:
    """Ratio of what EIV-MOESP and PR-MOESP take on the same trials."""
    pr, eiv = (case.measurement(f"{method}_{quantity}").value for method in ("pr-moesp", "eiv-moesp"))
    ratio = case.above("", case.measurement(f"{quantity}_ratio"), case.paper)
    return case.compare("ratio", [ratio], f"PR-MOESP {pr:.3g} {unit}, EIV-MOESP {eiv:.3g} {unit}")


def check_table2_text(case: Case) -> Row:
    """Numbers of Table 2 against those of the text."""
    table = case.tables["table2"].dropna(subset="text")
    difference = (table["paper"] - table["text"]).abs()
    pairs = [f"{row.torque} {row.paper:g} % and {row.text:g} %" for row in table[difference > 0].itertuples()]
    reason = f"table and text differ for the parallel cascade: {', '.join(pairs)}" if pairs else "they agree"
    return state(float(difference.max()), case.paper, reason, otherwise=judgement.CONTRADICTION)


def check_open_loop_methods_biased(case: Case) -> Row:
    """K is wrong in closed loop, and right in open loop, by every method that was made for open loop.

    Open loop is the control: an error that is there in open loop, too, does not come from the loop.
    """
    comparisons = []
    for method, study in OPEN_LOOP_METHODS.items():
        own = PULSES if method == "real-time" else {}
        closed, opened = (case.error(study, method, **own, closed_loop=loop) for loop in (True, False))
        label = case.study(study).labels.get(method, method)
        comparisons.append(case.above(f"{label} in closed loop", closed, size=True))
        comparisons.append(case.within(f"{label} in open loop, the control", opened, control=True))
    return case.compare("error of K [%]", comparisons)


def check_unbiased(case: Case, method: str, variant: str = "") -> Row:
    """K is right in closed loop at every level of voluntary torque."""
    errors = {
        name: {
            f"{100 * level:g} % voluntary torque": case.error("voluntary", name, voluntary=level, closed_loop=True)
            for level in case.levels("voluntary")
        }
        for name in filter(None, (method, variant))
    }
    comparisons = [case.within(label, error) for label, error in errors[method].items()]
    texts = [describe_result(error) for error in errors.get(variant, {}).values()]
    remark = f"with instruments for B and D, too: {', '.join(texts)}" if variant else ""
    return case.compare("error of K in closed loop [%]", comparisons, remark)


def check_net_vaf_hides_bias(case: Case) -> Row:
    """PR-MOESP explains more of the net torque than riv, and has a wrong K."""
    lead = case.lead("voluntary", ("pr-moesp", "net"), ("riv", "net"), closed_loop=True)
    error = case.error("voluntary", "pr-moesp", closed_loop=True)
    comparisons = [
        Comparison("net VAF less that of riv [points]", lead, (0.0, np.inf)),
        case.above("error of K [%]", error, size=True),
    ]
    return case.compare("PR-MOESP", comparisons, ours=error)


def check_accurate(case: Case, arms: Mapping[str, str]) -> Row:
    """K by PR-MOESP with one basis over all trials at the setting of Table 1."""
    samples = [case.values(study, "K_error", method) for study, method in arms.items() if study in case.studies]
    if not samples:
        raise MissingEvidence(f"none of the studies {', '.join(arms)} was run.")
    return case.compare("error of K over all trials [%]", [case.within("", Mean.of(np.concatenate(samples)))])


def check_real_time_input(case: Case) -> Row:
    """K by the real-time algorithm in open loop is right with its perturbation, and wrong with a PRBS."""
    pulses, prbs = (
        case.error("real-time", "real-time", perturbation=name, closed_loop=False) for name in ("pulses", "prbs")
    )
    comparisons = [case.within("with the perturbation", pulses), case.above("with a PRBS", prbs, size=True)]
    return case.compare("error of K in open loop [%]", comparisons)


CLAIM_CHECKS: dict[str, Callable[[Case], Row]] = {
    "table_number": check_table_number,
    "similar": partial(check_alike, first="pr-moesp", second="eiv-moesp", torques=list(VAF_COLUMNS)),
    "cascade_net_good": check_cascade_net_good,
    "cascade_better_in_open_loop": check_cascade_better_in_open_loop,
    "figure4_pr": check_figure4_pr,
    "figure4_cascade_biased": check_figure4_cascade_biased,
    "figure4_cascade_falls": check_figure4_cascade_falls,
    "figure4_cause": check_figure4_cause,
    "figure4_count": check_figure4_count,
    "eq17_gain": check_eq17_gain,
    "eq10_constant": check_eq10_constant,
    "eq11_zero": partial(check_alike, first="pr-moesp-free-b", second="pr-moesp", torques=["net"]),
    "columns_eiv": partial(check_columns, method="eiv-moesp", text="3 + 5 inputs and 1 output"),
    "columns_pr": partial(
        check_columns, method="pr-moesp", text="the reference alone; the correlation form needs {:g} rows"
    ),
    "economy_time": partial(check_economy, quantity="milliseconds", unit="ms"),
    "economy_memory": partial(check_economy, quantity="megabytes", unit="MB"),
    "table2_text": check_table2_text,
    "open_loop_methods_biased": check_open_loop_methods_biased,
    "eiv_unbiased": partial(check_unbiased, method="eiv-moesp"),
    "riv_unbiased": partial(check_unbiased, method="riv"),
    "pr_unbiased": partial(check_unbiased, method="pr-moesp", variant="pr-moesp-instruments"),
    "net_vaf_hides_bias": check_net_vaf_hides_bias,
    "pr_accurate": partial(check_accurate, arms=CHEBYSHEV),
    "pr_accurate_rectifier": partial(check_accurate, arms=RECTIFIER),
    "real_time_input": check_real_time_input,
}  # by the name that the claims give
