"""How each number and claim of the paper is checked: what is compared with what.

The rule that turns comparisons into a verdict is in `judgement`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import stats

from ankleloop.paper.evidence import VAF_COLUMNS, Case, MissingEvidence
from ankleloop.paper.judgement import (
    BY_CONSTRUCTION,
    CONTRADICTION,
    LEVEL,
    NOT_REPRODUCED,
    Comparison,
    Mean,
    Measurement,
    Quantity,
    describe_result,
)

ONE_PASS, CONVERGED = "parallel-cascade-one-pass", "parallel-cascade"
# Methods that were made for open loop with their studies. The real-time algorithm needs its own perturbation.
OPEN_LOOP_METHODS = {"pi-moesp": "voluntary", "po-moesp": "voluntary", CONVERGED: "voluntary", "real-time": "real-time"}
PULSES = {"perturbation": "pulses", "reflex_gain": 5.0}
# Methods by study that are PR-MOESP with one basis, as published otherwise.
CHEBYSHEV = {"table1": "pr-moesp", "projection": "ordinary", "obstacles": "pr-chebyshev"}
RECTIFIER = {"projection": "ordinary-rectifier", "obstacles": "pr-rectifier"}
REPLICATES = 2000  # of the bootstrap


@dataclass(frozen=True)
class Compared:
    """Result of a check that compares results of a run."""

    what: str  # what was compared, in front of the results
    comparisons: Sequence[Comparison]  # comparisons that the claim needs all
    remark: str = ""  # what was found beside them
    ours: Quantity | None = None  # our value for the ledger; by default that of the decisive comparison


@dataclass(frozen=True)
class Fact:
    """Result of a check of what no run can change, such as a count in the paper, or what follows from a definition."""

    value: float  # the fact
    expected: float  # what the paper says, or what the definition gives
    reason: str  # the fact in a sentence without its full stop
    of_paper: bool = False  # it is a fact of the paper alone, which then contradicts itself if the two differ

    @property
    def verdict(self) -> str:
        """Verdict on the claim."""
        if self.value == self.expected:
            return BY_CONSTRUCTION
        return CONTRADICTION if self.of_paper else NOT_REPRODUCED


def check_table_number(case: Case) -> Compared:
    """A number of a table is the mean over trials at the settings that the table names."""
    name, column = case.claim["study"], f"vaf_{case.claim['torque']}_{case.claim['against']}"
    comparison = case.within("", Mean.of(case.values(name, column, case.claim["method"])), case.paper)
    remark = "the table sets no tolerance" if np.isnan(case.tolerance) else ""
    if name == "table2" and case.study(name).kind == "simulation":
        remark = "the recording is not public, and this is a simulated stand-in"
    return Compared("mean VAF [%]", [comparison], remark)


def check_similar(case: Case) -> Compared:
    """PR-MOESP and EIV-MOESP differ little in Table 1, on the same trials."""
    leads = {torque: case.lead("table1", ("pr-moesp", torque), ("eiv-moesp", torque)) for torque in VAF_COLUMNS}
    comparisons = [case.within(torque, lead) for torque, lead in leads.items()]
    return Compared("VAF by PR-MOESP less that by EIV-MOESP [points]", comparisons)


def check_cascade_net_good(case: Case) -> Compared:
    """One pass of the parallel cascade gives a good net torque from poor parts."""
    net = case.vaf("table1", ONE_PASS, "net")
    comparisons = [case.within("net torque", net, case.paper)]
    for part in ("intrinsic", "reflex"):
        lead = case.lead("table1", (ONE_PASS, "net"), (ONE_PASS, part))
        comparisons.append(case.above(f"net less {part} torque", lead))
    return Compared("VAF [%]", comparisons, ours=net)


def check_cascade_better_in_open_loop(case: Case) -> Compared:
    """One pass of the parallel cascade gives better torques of both paths in open loop."""
    comparisons = []
    for part in ("intrinsic", "reflex"):
        opened, closed = (case.vaf("voluntary", ONE_PASS, part, closed_loop=loop) for loop in (False, True))
        comparisons.append(case.above(f"{part} torque", opened - closed))
    return Compared("VAF in open loop less that in closed loop [points]", comparisons)


def check_figure4_pr(case: Case) -> Compared:
    """PR-MOESP is good at every gain."""
    comparisons = [
        case.above(
            f"{torque} torque at gain {gain:g}", case.vaf("figure4", "pr-moesp", torque, reflex_gain=gain), case.paper
        )
        for gain in case.levels("reflex_gain")
        for torque in VAF_COLUMNS
    ]
    return Compared("mean VAF [%]", comparisons)


def check_figure4_cascade_biased(case: Case) -> Compared:
    """The intrinsic torque by one pass of the parallel cascade is wrong at every gain, most of all at the highest."""
    gains = sorted(case.levels("reflex_gain"))
    means = {gain: case.vaf("figure4", ONE_PASS, "intrinsic", reflex_gain=gain) for gain in gains}
    comparisons = [case.below(f"gain {gain:g}", mean, 100.0) for gain, mean in means.items()]
    fall = case.below("highest gain less lowest", means[gains[-1]] - means[gains[0]])
    return Compared("intrinsic VAF [%]", [*comparisons, fall])


def check_figure4_cascade_falls(case: Case) -> Compared:
    """The intrinsic VAF of one pass of the parallel cascade falls with the gain: rank correlation with its interval."""
    gains, column = sorted(case.levels("reflex_gain")), VAF_COLUMNS["intrinsic"]
    trials = {gain: case.values("figure4", column, ONE_PASS, reflex_gain=gain).to_numpy() for gain in gains}
    remark = f"from {trials[gains[0]].mean():.1f} to {trials[gains[-1]].mean():.1f} % over {len(gains)} gains"
    comparison = case.within("", bootstrap_rank_correlation(trials), case.paper)
    return Compared("rank correlation of gain and intrinsic VAF", [comparison], remark)


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
    low, high = np.quantile(replicates, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Measurement(value, float(min(low, value)), float(max(high, value)))


def _rank_correlation(gains: Sequence[float], means: np.ndarray) -> np.ndarray:
    """Spearman's rank correlation of the gains with each row of means; nan where all of them are equal."""
    with np.errstate(invalid="ignore"):
        return np.corrcoef(stats.rankdata(gains), stats.rankdata(means, axis=-1))[0, 1:]


def check_figure4_cause(case: Case) -> Compared:
    """The converged parallel cascade is biased on the same closed-loop trials, too."""
    first, last = (case.vaf("figure4", method, "intrinsic") for method in (ONE_PASS, CONVERGED))
    passes = case.values("figure4", "passes", CONVERGED).mean()
    remark = f"after {passes:.0f} passes on average; {first.value:.4g} % after one pass on the same closed-loop trials"
    return Compared("intrinsic VAF of the converged cascade [%]", [case.below("", last, 100.0)], remark)


def check_figure4_count(case: Case) -> Fact:
    """Number of gains from 10 to 30 in steps of 1."""
    count = len(case.levels("reflex_gain"))
    return Fact(count, case.paper, f"gains from 10 to 30 in steps of 1 are {count}", of_paper=True)


def check_eq17_gain(case: Case) -> Compared:
    """Table 1 with the gain of Eq. 17 as printed."""
    comparison = case.within("", case.vaf("table1", ONE_PASS, "intrinsic"), case.paper)
    return Compared("intrinsic VAF of one pass with a gain of 2 [%]", [comparison])


def check_eq10_constant(case: Case) -> Fact:
    """Directions that a constant among the inputs adds: none, whatever the data, because means are removed."""
    directions, rows = (case.measurement(f"constant_{name}").value for name in ("directions", "rows"))
    reason = (
        f"its {rows:g} Hankel rows are all alike and add {directions:g} directions once means are removed, so no "
        "result depends on it: it is left out, and a fifth-order basis is T1 … T5 in the usual numbering, five inputs"
    )
    return Fact(directions, case.tolerance, reason)


def check_eq11_zero(case: Case) -> Compared:
    """Change of the net VAF if B is free, on the same trials."""
    change = case.lead("table1", ("pr-moesp-free-b", "net"), ("pr-moesp", "net"))
    return Compared("change of the net VAF by leaving B free [points]", [case.within("", change)])


def check_columns(case: Case, method: str, text: str) -> Fact:
    """Columns of instruments, which follow from the definition of a method."""
    names = (f"{method}_instrument_rows", "block_rows", "correlation_rows")
    rows, block_rows, correlation_rows = (case.measurement(name).value for name in names)
    reason = f"{rows:g} rows of instruments over {block_rows:g} block rows: {text.format(correlation_rows)}"
    return Fact(rows / block_rows, case.paper, reason)


def check_economy(case: Case, quantity: str, unit: str) -> Compared:
    """Ratio of what EIV-MOESP and PR-MOESP take on the same trials."""
    pr, eiv = (case.measurement(f"{method}_{quantity}").value for method in ("pr-moesp", "eiv-moesp"))
    ratio = case.above("", case.measurement(f"{quantity}_ratio"), case.paper)
    return Compared("ratio", [ratio], f"PR-MOESP {pr:.3g} {unit}, EIV-MOESP {eiv:.3g} {unit}")


def check_table2_text(case: Case) -> Fact:
    """Numbers of Table 2 against those of the text."""
    table = case.tables["table2"].dropna(subset="text")
    difference = (table["paper"] - table["text"]).abs()
    pairs = [f"{row.torque} {row.paper:g} % and {row.text:g} %" for row in table[difference > 0].itertuples()]
    reason = f"table and text differ for the parallel cascade: {', '.join(pairs)}" if pairs else "they agree"
    return Fact(float(difference.max()), case.paper, reason, of_paper=True)


def check_open_loop_methods_biased(case: Case) -> Compared:
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
    return Compared("error of K [%]", comparisons)


def check_unbiased(case: Case, method: str, variant: str = "") -> Compared:
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
    return Compared("error of K in closed loop [%]", comparisons, remark)


def check_net_vaf_hides_bias(case: Case) -> Compared:
    """PR-MOESP explains more of the net torque than riv, and has a wrong K."""
    lead = case.lead("voluntary", ("pr-moesp", "net"), ("riv", "net"), closed_loop=True)
    error = case.error("voluntary", "pr-moesp", closed_loop=True)
    comparisons = [
        Comparison("net VAF less that of riv [points]", lead, (0.0, np.inf)),
        case.above("error of K [%]", error, size=True),
    ]
    return Compared("PR-MOESP", comparisons, ours=error)


def check_accurate(case: Case, arms: Mapping[str, str]) -> Compared:
    """K by PR-MOESP with one basis over all trials at the setting of Table 1, and without noise for comparison."""
    samples = [case.values(study, "K_error", method) for study, method in arms.items() if study in case.studies]
    if not samples:
        raise MissingEvidence(f"none of the studies {', '.join(arms)} was run.")
    try:
        clean = case.error("obstacles", arms["obstacles"], voluntary=0.0, snr_db=None).value
        remark = f"{clean:.2g} % without noise and voluntary torque"
    except MissingEvidence as missing:
        remark = f"not known without noise: {missing}"
    error = case.within("", Mean.of(np.concatenate(samples)))
    return Compared("error of K over all trials [%]", [error], remark)


def check_real_time_input(case: Case) -> Compared:
    """K by the real-time algorithm in open loop is right with its perturbation, and wrong with a PRBS."""
    pulses, prbs = (
        case.error("real-time", "real-time", perturbation=name, closed_loop=False) for name in ("pulses", "prbs")
    )
    comparisons = [case.within("with the perturbation", pulses), case.above("with a PRBS", prbs, size=True)]
    return Compared("error of K in open loop [%]", comparisons)


CLAIM_CHECKS: dict[str, Callable[[Case], Compared | Fact]] = {
    "table_number": check_table_number,
    "similar": check_similar,
    "cascade_net_good": check_cascade_net_good,
    "cascade_better_in_open_loop": check_cascade_better_in_open_loop,
    "figure4_pr": check_figure4_pr,
    "figure4_cascade_biased": check_figure4_cascade_biased,
    "figure4_cascade_falls": check_figure4_cascade_falls,
    "figure4_cause": check_figure4_cause,
    "figure4_count": check_figure4_count,
    "eq17_gain": check_eq17_gain,
    "eq10_constant": check_eq10_constant,
    "eq11_zero": check_eq11_zero,
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
