"""How each number and claim of the paper is checked: what is compared, and its reason in a sentence.

Claims on bias in closed loop are in `bias_checks`, the rule that turns comparisons into a verdict is in `judgement`.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy import stats

from ankleloop.paper import bias_checks  # noqa: F401 # registers its checks
from ankleloop.paper.captions import format_setting, label_setting
from ankleloop.paper.checks import (
    CheckResult,
    Claim,
    at_least,
    at_most,
    claim_check,
    claim_settings,
    describe_unexplained,
    format_signed,
    within,
)
from ankleloop.paper.evidence import Evidence, MissingEvidence, StudyResults, parse_settings
from ankleloop.paper.judgement import Comparison, Fact, Replicates

ONE_PASS, CONVERGED = "parallel-cascade-one-pass", "parallel-cascade"
PARTS = ("intrinsic", "reflex")
TARGETS = {"net": "measured", "intrinsic": "true", "reflex": "true"}  # what Table 1 scores each torque against
REPLICATES = 2000  # of the bootstrap


def check_table_number(claim: Claim, evidence: Evidence) -> CheckResult:
    """Compare a number of a table with the mean over trials at the settings that the table names."""
    study, paper = evidence.study(claim["study"]), claim["paper"]
    settings = claim_settings(claim) if study.kind == "simulation" else {}
    mean = study.mean_vaf(study.point(**settings), claim["method"], claim["torque"], claim["against"])
    if claim["study"] == "table2" and study.kind == "simulation":
        reason = f"the recording is not public; a simulated stand-in gives {mean.text} %"
        return CheckResult(reason, [Comparison("", mean, within(np.nan), paper)])
    difference, tolerance = mean.value - paper, claim.get("tolerance", np.nan)
    side = "above" if difference > 0 else "below"
    place = ", ".join(
        f"{label_setting(name)[0]} {format_setting(name, value)}"
        for name, value in settings.items()
        if name in study.varied
    )
    reason = f"ours is {abs(difference):.1f} points {side} the paper's {paper:g} %" + (f" at {place}" if place else "")
    if ratio := describe_unexplained(mean.value, paper):
        reason += f", with {ratio}"
    if np.isnan(tolerance):
        reason += ": the table sets no tolerance"
    return CheckResult(reason, [Comparison("", mean, within(tolerance), paper)])


@claim_check
def check_similar(claim: Claim, evidence: Evidence) -> CheckResult:
    """PR-MOESP and EIV-MOESP differ little in Table 1, on the same trials."""
    study = evidence.study("table1")
    point = study.point(**claim_settings(claim))
    texts, comparisons = [], []
    for torque, against in TARGETS.items():
        arms = [(method, torque, against) for method in ("pr-moesp", "eiv-moesp")]
        difference = study.vaf_difference(point, *arms)
        comparisons.append(Comparison(torque, difference, within(claim["tolerance"])))
        ratio = describe_unexplained(*(study.mean_vaf(point, *arm).value for arm in arms))
        texts.append(f"{torque} {format_signed(difference)}" + (f" ({ratio})" if ratio else ""))
    return CheckResult(f"PR-MOESP less EIV-MOESP, points of VAF: {', '.join(texts)}", comparisons)


@claim_check
def check_cascade_net_good(claim: Claim, evidence: Evidence) -> CheckResult:
    """One pass of the parallel cascade gives a good net torque from poor parts."""
    study = evidence.study("table1")
    point = study.point(**claim_settings(claim))
    net = study.mean_vaf(point, ONE_PASS, "net", "measured")
    comparisons = [Comparison("net torque", net, within(claim["tolerance"]), claim["paper"])]
    texts = [f"net VAF {net.text} %"]
    for part in PARTS:
        arms = [(ONE_PASS, torque, TARGETS[torque]) for torque in ("net", part)]
        difference = study.vaf_difference(point, *arms)
        comparisons.append(Comparison(f"net less {part} torque", difference, at_least(claim["tolerance"])))
        texts.append(f"{part} VAF {study.mean_vaf(point, ONE_PASS, part).text} %")
    return CheckResult(", ".join(texts), comparisons, ours=net)


@claim_check
def check_cascade_better_in_open_loop(claim: Claim, evidence: Evidence) -> CheckResult:
    """One pass of the parallel cascade gives better torques of both paths in open loop."""
    study, settings = evidence.study("voluntary"), claim_settings(claim)
    texts, comparisons = [], []
    for torque in PARTS:
        opened, closed = (
            study.mean_vaf(study.point(**settings, closed_loop=loop), ONE_PASS, torque) for loop in (False, True)
        )
        comparisons.append(Comparison(f"{torque} torque", opened - closed, at_least(claim["tolerance"])))
        texts.append(f"{torque} VAF {opened.text} % in open loop, {closed.text} % in closed loop")
    return CheckResult("; ".join(texts), comparisons)


def _points_by_gain(study: StudyResults, claim: Claim) -> dict[float, str]:
    """Points at the reflex gains that a claim on Figure 4 names, from the lowest to the highest."""
    settings = parse_settings(claim["settings"])
    gains = sorted(settings.pop("reflex_gain"))
    others = {name: values[0] for name, values in settings.items()}
    return {gain: study.point(reflex_gain=gain, **others) for gain in gains}


@claim_check
def check_figure4_pr(claim: Claim, evidence: Evidence) -> CheckResult:
    """PR-MOESP is good at every gain."""
    study, tolerance = evidence.study("figure4"), claim["tolerance"]
    means = {
        f"{torque} torque at gain {gain:g}": study.mean_vaf(point, "pr-moesp", torque)
        for gain, point in _points_by_gain(study, claim).items()
        for torque in TARGETS
    }
    worst, lowest = min(means.items(), key=lambda item: item[1].value)
    reason = f"the lowest mean VAF is {lowest.text} % ({worst}), the paper's lowest in Table 1 {claim['paper']:g} %"
    if ratio := describe_unexplained(lowest.value, claim["paper"]):
        reason += f": {ratio}"
    comparisons = [Comparison(label, mean, at_least(-tolerance), claim["paper"]) for label, mean in means.items()]
    return CheckResult(reason, comparisons)


@claim_check
def check_figure4_cascade_biased(claim: Claim, evidence: Evidence) -> CheckResult:
    """The intrinsic torque by one pass of the parallel cascade is wrong at every gain, most of all at the highest."""
    study = evidence.study("figure4")
    means = {
        gain: study.mean_vaf(point, ONE_PASS, "intrinsic") for gain, point in _points_by_gain(study, claim).items()
    }
    low, high = means[min(means)], means[max(means)]
    reason = f"intrinsic VAF {low.text} % at gain {min(means):g}, {high.text} % at gain {max(means):g}"
    return CheckResult(
        reason,
        [Comparison(f"gain {gain:g}", mean, at_most(-claim["tolerance"]), 100.0) for gain, mean in means.items()]
        + [Comparison("highest gain less lowest", high - low, at_most(-claim["tolerance"]))],
    )


@claim_check
def check_figure4_cascade_falls(claim: Claim, evidence: Evidence) -> CheckResult:
    """The intrinsic VAF of one pass of the parallel cascade falls with the gain: rank correlation with its interval."""
    study = evidence.study("figure4")
    trials = {
        gain: study.vafs(point, ONE_PASS, "intrinsic").to_numpy()
        for gain, point in _points_by_gain(study, claim).items()
    }
    gains, means = np.array(list(trials)), np.array([values.mean() for values in trials.values()])
    correlation = Replicates(_rank_correlation(gains, means[None])[0], _bootstrap_correlations(gains, trials.values()))
    low, high = correlation.interval()
    reason = (
        f"rank correlation {correlation.value:.2f} ({low:.2f} … {high:.2f}) over {gains.size} gains, from "
        f"{means[0]:.1f} to {means[-1]:.1f} %"
    )
    return CheckResult(reason, [Comparison("", correlation, within(claim["tolerance"]), claim["paper"])])


def _rank_correlation(gains: np.ndarray, means: np.ndarray) -> np.ndarray:
    """Spearman's rank correlation of the gains with each row of means; nan where all of them are equal."""
    first, second = stats.rankdata(gains), stats.rankdata(means, axis=-1)
    first, second = first - first.mean(), second - second.mean(axis=-1, keepdims=True)
    size = np.sqrt(np.sum(first**2) * np.sum(second**2, axis=-1))
    return second @ first / np.where(size > 0, size, np.nan)


def _bootstrap_correlations(gains: np.ndarray, samples: Iterable[np.ndarray]) -> np.ndarray:
    """Rank correlations of means of trials drawn with replacement; none from a single trial."""
    rng, means = np.random.default_rng(0), []
    for sample in samples:
        if sample.size < 2:
            return np.empty(0)
        means.append(sample[rng.integers(sample.size, size=(REPLICATES, sample.size))].mean(axis=1))
    return _rank_correlation(gains, np.column_stack(means))


@claim_check
def check_figure4_cause(claim: Claim, evidence: Evidence) -> CheckResult:
    """The converged parallel cascade is biased on the same closed-loop trials, too."""
    study = evidence.study("figure4")
    (gain, point), *_ = _points_by_gain(study, claim).items()
    first, last = (study.mean_vaf(point, method, "intrinsic") for method in (ONE_PASS, CONVERGED))
    passes = study.mean_parameter("passes", point, CONVERGED)
    reason = (
        f"at gain {gain:g} the intrinsic VAF is {first.text} % after one pass, and {last.text} % on the same "
        f"closed-loop trials after {passes.value:.0f} passes on average"
    )
    return CheckResult(reason, [Comparison("", last, at_most(-claim["tolerance"]), 100.0)])


@claim_check
def check_figure4_count(claim: Claim, evidence: Evidence) -> CheckResult:
    """Number of gains from 10 to 30 in steps of 1."""
    count = len(parse_settings(claim["settings"])["reflex_gain"])
    reason = f"gains from 10 to 30 in steps of 1 are {count}"
    return CheckResult(reason, fact=Fact(count, claim["paper"], of_paper=True))


@claim_check
def check_eq17_gain(claim: Claim, evidence: Evidence) -> CheckResult:
    """Table 1 with the gain of Eq. 17 as printed."""
    study = evidence.study("table1")
    printed = study.mean_vaf(study.point(**claim_settings(claim)), ONE_PASS, "intrinsic")
    reason = (
        f"with a gain of 2 one pass of the parallel cascade finds {printed.text} % of the intrinsic torque, where "
        f"Table 1 has {claim['paper']:g} %"
    )
    return CheckResult(reason, [Comparison("", printed, within(claim["tolerance"]), claim["paper"])])


@claim_check
def check_eq10_constant(claim: Claim, evidence: Evidence) -> CheckResult:
    """Directions that a constant among the inputs adds: none, whatever the data, because means are removed."""
    directions, rows = (evidence.measurement(f"constant_{name}").value for name in ("directions", "rows"))
    reason = (
        f"its {rows:g} Hankel rows are all alike and add {directions:g} directions once means are removed, so no "
        "result depends on it: it is left out, and a fifth-order basis is T1 … T5 in the usual numbering, five inputs"
    )
    return CheckResult(reason, fact=Fact(directions, claim["tolerance"]))


@claim_check
def check_eq11_zero(claim: Claim, evidence: Evidence) -> CheckResult:
    """Change of the net VAF if B is free, on the same trials."""
    study = evidence.study("table1")
    arms = [(method, "net", "measured") for method in ("pr-moesp-free-b", "pr-moesp")]
    change = study.vaf_difference(study.point(**claim_settings(claim)), *arms)
    reason = f"leaving B free changes the net VAF by {format_signed(change, 2)} points"
    return CheckResult(reason, [Comparison("", change, within(claim["tolerance"]))])


def _count_columns(claim: Claim, evidence: Evidence, method: str, text: str) -> CheckResult:
    """Columns of instruments, which follow from the definition of a method."""
    rows, block_rows = (evidence.measurement(name).value for name in (f"{method}_instrument_rows", "block_rows"))
    reason = f"{rows:g} rows of instruments over {block_rows:g} block rows: {text}"
    return CheckResult(reason, fact=Fact(rows / block_rows, claim["paper"]))


@claim_check
def check_columns_eiv(claim: Claim, evidence: Evidence) -> CheckResult:
    """Columns of instruments of EIV-MOESP."""
    return _count_columns(claim, evidence, "eiv-moesp", "3 + 5 inputs and 1 output")


@claim_check
def check_columns_pr(claim: Claim, evidence: Evidence) -> CheckResult:
    """Columns of instruments of PR-MOESP."""
    needed = evidence.measurement("correlation_rows").value
    text = f"the reference alone, in the ordinary form; the correlation form needs {needed:g} rows"
    return _count_columns(claim, evidence, "pr-moesp", text)


def _check_economy(claim: Claim, evidence: Evidence, quantity: str, unit: str) -> CheckResult:
    """Ratio of what EIV-MOESP and PR-MOESP take on the same trials."""
    pr, eiv = (evidence.measurement(f"{method}_{quantity}").value for method in ("pr-moesp", "eiv-moesp"))
    ratio = evidence.measurement(f"{quantity}_ratio")
    reason = (
        f"PR-MOESP {pr:.3g} {unit}, EIV-MOESP {eiv:.3g} {unit}: ratio {ratio.value:.2f} "
        f"({ratio.low:.2f} … {ratio.high:.2f})"
    )
    return CheckResult(reason, [Comparison("", ratio, at_least(claim["tolerance"]), claim["paper"])])


@claim_check
def check_economy_time(claim: Claim, evidence: Evidence) -> CheckResult:
    """Time of EIV-MOESP over that of PR-MOESP."""
    return _check_economy(claim, evidence, "milliseconds", "ms")


@claim_check
def check_economy_memory(claim: Claim, evidence: Evidence) -> CheckResult:
    """Peak memory of EIV-MOESP over that of PR-MOESP."""
    return _check_economy(claim, evidence, "megabytes", "MB")


@claim_check
def check_table2_text(claim: Claim, evidence: Evidence) -> CheckResult:
    """Numbers of Table 2 against those of the text."""
    if "table2" not in evidence.tables:
        raise MissingEvidence("there is no table2 among the published tables.")
    table = evidence.tables["table2"].dropna(subset="text")
    difference = (table["paper"] - table["text"]).abs()
    pairs = [f"{row.torque} {row.paper:g} % and {row.text:g} %" for row in table[difference > 0].itertuples()]
    reason = f"table and text differ for the parallel cascade: {', '.join(pairs)}" if pairs else "they agree"
    return CheckResult(reason, fact=Fact(float(difference.max()), claim["paper"], of_paper=True))
