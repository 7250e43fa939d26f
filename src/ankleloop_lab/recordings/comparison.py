"""Conditions within subjects, or groups of subjects: means, differences, and how well sessions repeat."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from scipy import special

from ankleloop.errors import DataError
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.vaf import confidence_margin
from ankleloop_lab.recordings.labels import order_conditions

COMPARED = ("K", "B", "I", "G")
POWER = 0.8  # probability that a difference is found
QUANTILE = 0.975  # of two-sided 95 %
NORMAL = 1.96  # that of the normal distribution
MOST_SUBJECTS = 1000
# Errors of no apparatus, by subject and apparatus.
EMPTY = pd.Series(dtype=float, index=pd.MultiIndex.from_arrays([[], []]))
NO_LABEL = ("", "–", None)  # cells without one
NO_TEXT = ("", None, np.nan)

Row = dict[str, Any]


def compare(
    table: pd.DataFrame,
    condition: str = "condition",
    within: str = "subject",
    *,
    between: str | None = None,
    size: float = 10.0,
) -> pd.DataFrame:
    r"""Compare the parameters of conditions within subjects, or of groups of subjects.

    Each subject has one value for each condition: the plain mean of its rows, which may be sessions. Over subjects, a
    mean and a paired difference :math:`d` of n subjects with the standard deviation s have Student's interval

    .. math:: \bar d \pm t_{0.975, \, n - 1} \, s / \sqrt{n}.

    With `between`, conditions are groups, each of its own subjects. The difference of the means of :math:`n_1` and
    :math:`n_2` subjects, with the standard deviations :math:`s_1` and :math:`s_2`, has Welch's interval,

    .. math:: \bar x_2 - \bar x_1 \pm t_{0.975, \, \nu} \sqrt{v_1 + v_2}, \qquad v_i = s_i^2 / n_i, \qquad
              \nu = \frac{(v_1 + v_2)^2}{v_1^2 / (n_1 - 1) + v_2^2 / (n_2 - 1)}.

    Subjects count alike: weights by the inverse variance of each estimate would favour those with a low K.

    An apparatus that is subtracted (`ankleloop.subtract`) moves all rows that share it alike, by :math:`s_A`, which
    their scatter does not show. With the weights :math:`w` of the rows, 1/n in a mean and ±1/n in a difference, the
    half width of every interval is

    .. math:: \sqrt{m^2 + 1.96^2 \sum_A \left(\sum_{i \in A} w_i s_{A,i}\right)^2}

    with the half width m without it. So it counts once in a mean, and cancels in a difference of conditions that share
    it.

    With several sessions, in the column `session`, the mean squares between subjects (:math:`MS_S`), between sessions
    (:math:`MS_T`) and of the rest (:math:`MS_E`), of n subjects with all k sessions, give the agreement of single
    sessions, the standard error of measurement and the smallest change of one subject that can be told from it,

    .. math:: ICC(2,1) = \frac{MS_S - MS_E}{MS_S + (k - 1) MS_E + k (MS_T - MS_E) / n}, \qquad
              SEM = \sqrt{MS_E}, \qquad MDC = 1.96 \sqrt{2} \, SEM.

    Parameters
    ----------
    table : pandas.DataFrame
        A row for each recording, from `ankleloop.identify_each` or with the columns K, B, I and G. Rows without a value
        are left out, and those that are not `trusted` where there is this column.
    condition : str
        Column of the conditions. They stand in the order of the numbers in them, those without a number first; without
        any in the order of appearance; a categorical column in its own order.
    within : str
        Column of the subjects, each of whom has several conditions.
    between : str, optional
        Column of the subjects, each of whom is in one condition: a group.
    size : float
        Difference for which the number of subjects is computed [%].

    Returns
    -------
    pandas.DataFrame
        Rows for each `parameter`, with its `unit`. `kind` is "mean" of a `condition`; "difference" of a `condition`
        from a `reference`, or with `between` "group difference"; or, with sessions, "ICC(2,1)", "SEM" and "MDC" of a
        condition. The number of `subjects`, the `value` with the ends `low` and `high` of its 95 % interval. Of a mean
        how many of its estimates are `remarked`, where the table has `remarks`: what moves the estimates of one
        condition is a difference. Of a paired difference also `percent`, `percent_low`, `percent_high`, the mean of the
        differences in % of the value that each subject has in the reference, where these are positive. Of any
        difference `needed`, the number of subjects, or of those in each group, that show a difference of `size` with a
        power of 80 %. Each interval holds by itself.

    Raises
    ------
    DataError
        If a column is missing, no row has a value, or with `between` a subject is in several groups.

    See Also
    --------
    ankleloop.identify_each : Makes the table.

    References
    ----------
    .. [1] P.E. Shrout, J.L. Fleiss, "Intraclass correlations: uses in assessing rater reliability", Psychological
       Bulletin 86(2):420-428, 1979. https://doi.org/10.1037/0033-2909.86.2.420
    .. [2] J.P. Weir, "Quantifying test-retest reliability using the intraclass correlation coefficient and the SEM",
       Journal of Strength and Conditioning Research 19(1):231-240, 2005. https://doi.org/10.1519/15184.1
    .. [3] B.L. Welch, "The generalization of 'Student's' problem when several different population variances are
       involved", Biometrika 34(1-2):28-35, 1947. https://doi.org/10.1093/biomet/34.1-2.28

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame({"subject": ["S1", "S2", "S3"] * 2, "condition": ["rest"] * 3 + ["10MVC"] * 3})
    >>> table["K"] = [100.0, 120.0, 80.0, 141.0, 160.0, 122.0]
    >>> result = compare(table, "condition")
    >>> print(describe_differences(result))
    K rises by 41 (38.52 … 43.48) N·m/rad from rest to 10MVC (3 subjects, paired 95 % intervals).
    >>> groups = table.assign(subject=["S1", "S2", "S3", "P1", "P2", "P3"], group=["control"] * 3 + ["stroke"] * 3)
    >>> result = compare(groups, "group", between="subject")
    >>> print(result.loc[2, ["kind", "value", "low", "high", "subjects"]].to_string(float_format="{:.1f}".format))
    kind        group difference
    value                   41.0
    low                     -3.3
    high                    85.3
    subjects                   6
    """
    subject = between or within
    used = select_rows(table, [condition, subject])
    if between is not None:
        _check_groups(used, condition, between)
    if pd.api.types.is_bool_dtype(
        used[condition].infer_objects()
    ):  # which would select rows and columns
        texts = pd.Categorical(used[condition].astype(bool).astype(str), ["False", "True"])
        used = used.assign(**{condition: texts})
    rows: list[Row] = []
    for name in COMPARED:
        if name not in used or used[name].isna().all():
            continue
        means = used.pivot_table(name, subject, condition, observed=True, sort=False)
        means = means[_order(used[condition], means)]
        shared = _tabulate_apparatus(used, name, subject, condition)
        found = _describe_means(means, shared, used, condition)
        found += _describe_differences(means, shared, size, paired=between is None)
        if "session" in used:
            sessions = used.pivot_table(name, subject, [condition, "session"], observed=True)
            for key in means:
                found += _describe_repeatability(sessions[[key]].dropna().to_numpy(), key)
        unit = QUANTITIES[name].unit
        rows += [{"parameter": name, "unit": unit, **row} for row in found]
    if not rows:
        raise DataError("no row has a value of K, B, I or G that can be trusted.")
    return pd.DataFrame(rows)


def select_rows(table: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Rows that can be trusted and have all of some labels."""
    for column in columns:
        if column not in table:
            known = ", ".join(map(str, table))
            raise DataError(f"the table has no column {column!r}; it has {known}.")
    used = table[table["trusted"].eq(True)] if "trusted" in table else table
    return used.dropna(subset=columns)


def _check_groups(table: pd.DataFrame, group: str, subject: str) -> None:
    """Refuse subjects who are in several groups."""
    counts = table.groupby(subject, observed=True, sort=False)[group].nunique()
    if (counts > 1).any():
        raise DataError(
            f"{counts.index[counts > 1][0]} is in several groups of {group!r}: compare within subjects, "
            f"within={subject!r}."
        )


def _order(conditions: pd.Series, known: pd.DataFrame) -> list[Any]:
    """Conditions that have a value, in the order in which they are compared."""
    if isinstance(conditions.dtype, pd.CategoricalDtype):
        order = list(conditions.cat.categories)
    else:
        order = order_conditions(conditions.unique())
    return [condition for condition in order if condition in known]


def _describe_means(
    means: pd.DataFrame, shared: dict[Any, pd.Series], table: pd.DataFrame, condition: str
) -> list[Row]:
    """Rows of the means of conditions."""
    rows = []
    for key in means:
        remarks = _count_remarks(table[table[condition] == key])
        row = {"kind": "mean", "condition": key, **_describe(means[key]), **remarks}
        rows.append(_widen(row, [shared[key]]))
    return rows


def _describe_differences(
    means: pd.DataFrame, shared: dict[Any, pd.Series], size: float, *, paired: bool
) -> list[Row]:
    """Rows of the differences of all pairs of conditions."""
    describe = _describe_difference if paired else _describe_group_difference
    rows = []
    for first, second in combinations(means, 2):
        errors = [-shared[first], shared[second]]
        if paired:  # of subjects who have both
            both = means[[first, second]].dropna().index
            errors = [part[part.index.isin(both, level=0)] for part in errors]
        rows.append(_widen(describe(means[first], means[second], size), errors))
    return rows


def _tabulate_apparatus(
    table: pd.DataFrame, name: str, subject: str, condition: str
) -> dict[Any, pd.Series]:
    """Standard errors that apparatuses alone give the values of each condition, by subject and apparatus."""
    column = f"{name}_apparatus"
    if column not in table:
        return dict.fromkeys(table[condition].unique(), EMPTY)
    used = table.dropna(subset=[name])
    errors = used[column].fillna(0.0).rename("error")
    rows = used.groupby([subject, condition], observed=True)[name].transform("size")
    names = [used[subject], used["apparatus"].fillna(""), used[condition]]
    sums = (errors / rows).groupby(names, observed=True).sum()  # of the mean of a subject's rows
    return {key: sums.xs(key, level=condition) for key in sums.index.unique(condition)}


def _widen(row: Row, parts: list[pd.Series]) -> Row:
    """A row whose interval holds the errors of apparatuses, too: those of one in all its rows are the same.

    `parts` are errors of the values of subjects, over the subjects of each of which the row is a mean.
    """
    means = [part.groupby(level=1).sum() / part.index.unique(0).size for part in parts if part.size]
    if not means:
        return row
    shared = NORMAL * np.sqrt(np.sum(pd.concat(means).groupby(level=0).sum() ** 2))
    margin = row["high"] - row["value"]
    if not shared or not margin > 0:
        return row
    factor = np.hypot(margin, shared) / margin
    ends = {}
    for value, *names in (("value", "low", "high"), ("percent", "percent_low", "percent_high")):
        for name in names:
            if name in row:
                ends[name] = row[value] + factor * (row[name] - row[value])
    return {**row, **ends}


def _describe(values: pd.Series) -> Row:
    """Mean over subjects with its interval."""
    count = values.count()
    mean = values.mean()
    margin = confidence_margin(values.std(), count)
    return {"subjects": count, "value": mean, "low": mean - margin, "high": mean + margin}


def _count_remarks(table: pd.DataFrame) -> Row:
    """How many of the estimates of a condition are remarked, where the table knows."""
    if "remarks" not in table:
        return {}
    return {"remarked": int((~table["remarks"].isin(NO_TEXT)).sum())}


def _describe_difference(first: pd.Series, second: pd.Series, size: float) -> Row:
    """Row of the paired difference of a condition from another one."""
    difference = (second - first).dropna()
    row = {"kind": "difference", "condition": second.name, "reference": first.name}
    row |= _describe(difference)
    base = first[difference.index]
    if (base > 0).all():
        percent = _describe(100.0 * difference / base)
        row["percent"] = percent["value"]
        row["percent_low"] = percent["low"]
        row["percent_high"] = percent["high"]
    if difference.std() > 0:
        row["needed"] = count_subjects(size / 100.0 * abs(base.mean()), difference.std())
    return row


def _describe_group_difference(first: pd.Series, second: pd.Series, size: float) -> Row:
    """Row of the difference of the means of two groups, with Welch's interval."""
    groups = [first.dropna(), second.dropna()]
    counts = np.array([group.size for group in groups])
    variances = np.array([group.var() for group in groups])
    shares = variances / counts
    value = second.mean() - first.mean()
    row = {
        "kind": "group difference",
        "condition": second.name,
        "reference": first.name,
        "subjects": counts.sum(),
        "value": value,
        "low": np.nan,
        "high": np.nan,
    }
    if shares.sum() > 0:  # of groups with two subjects or more
        freedom = shares.sum() ** 2 / np.sum(shares**2 / (counts - 1))
        margin = special.stdtrit(freedom, QUANTILE) * np.sqrt(shares.sum())
        row["low"] = value - margin
        row["high"] = value + margin
        deviation = np.sqrt(variances.mean())
        row["needed"] = count_subjects(size / 100.0 * abs(first.mean()), deviation, groups=2)
    return row


def count_subjects(difference: float, deviation: float, groups: int = 1) -> float:
    """Number of subjects that show a difference with a power of 80 %, by the t test at a level of 5 %.

    `deviation` is the standard deviation over subjects of the paired differences; of two groups that of the values in
    each, and the number is that of each group. Infinite above a thousand.

    >>> count_subjects(5.0, 10.0), count_subjects(8.0, 10.0)
    (34.0, 15.0)
    >>> count_subjects(5.0, 10.0, groups=2)
    64.0
    """
    counts = np.arange(2.0, MOST_SUBJECTS + 1.0)
    freedom = groups * (counts - 1.0)
    quantile = special.stdtrit(freedom, QUANTILE)
    shift = difference / deviation * np.sqrt(counts / groups)
    missed = special.nctdtr(freedom, shift, quantile)
    enough = counts[missed <= 1.0 - POWER]
    return float(enough[0]) if enough.size else np.inf


def _describe_repeatability(values: np.ndarray, condition: Any) -> list[Row]:
    """Rows of the agreement of the values of subjects (rows) in sessions (columns), by the analysis of variance."""
    n, k = values.shape
    if n < 2 or k < 2:
        return []
    mean = values.mean()
    of_subjects = values.mean(axis=1) - mean
    of_sessions = values.mean(axis=0) - mean
    rest = values - mean - of_subjects[:, None] - of_sessions
    ms_subjects = k * np.sum(of_subjects**2) / (n - 1)
    ms_sessions = n * np.sum(of_sessions**2) / (k - 1)
    ms_rest = np.sum(rest**2) / ((n - 1) * (k - 1))
    total = ms_subjects + (k - 1) * ms_rest + k * (ms_sessions - ms_rest) / n
    common = {"condition": condition, "subjects": n}
    sem = np.sqrt(ms_rest)
    icc = (ms_subjects - ms_rest) / total
    return [
        {**common, "kind": "ICC(2,1)", "unit": "1", "value": icc},
        {**common, "kind": "SEM", "value": sem},
        {**common, "kind": "MDC", "value": NORMAL * np.sqrt(2.0) * sem},
    ]


def select_comparable(table: pd.DataFrame) -> pd.DataFrame | None:
    """Recordings whose conditions can be compared within subjects, a row for each; None where there are none.

    All are by the method that is recommended most often, so that no difference is one of methods. Where no
    session is stated, several trials of a subject in a condition are sessions.

    Parameters
    ----------
    table : pandas.DataFrame
        A row for each recording and method, as the workflow and `ankleloop identify` have it.

    Examples
    --------
    >>> select_comparable(pd.DataFrame({"subject": ["S1"], "condition": [""], "recommended": [True]})) is None
    True
    """
    recommended = table[table["recommended"].eq(True)]
    groups = table[["subject", "condition"]]
    if recommended.empty or groups.isin(NO_LABEL).any(axis=None):
        return None
    used = table[table["label"] == recommended["label"].mode()[0]]
    used = select_rows(used, list(groups))
    if used["subject"].nunique() < 2 or used["condition"].nunique() < 2:
        return None
    is_stated = ~used["session"].isin(NO_LABEL)
    return used.assign(session=used["session"].where(is_stated, used["trial"]))


def describe_differences(comparison: pd.DataFrame, name: str = "K") -> str:
    """Differences of a parameter from the first condition, in a sentence."""
    kinds = ["difference", "group difference"]
    rows = comparison[(comparison["parameter"] == name) & comparison["kind"].isin(kinds)]
    if rows.empty:
        return f"There are no two conditions with values of {name}."
    rows = rows[rows["reference"] == rows["reference"].iloc[0]]
    sentence = ", and ".join(_describe_change(row) for _, row in rows.iterrows())
    sentence = f"{sentence[0].upper()}{sentence[1:]}"
    counts = rows.loc[rows["subjects"] > 0, "subjects"].unique()
    if not counts.size:
        return f"{sentence}."
    test = "paired" if rows["kind"].iloc[0] == "difference" else "Welch's"
    remarks = _describe_remarks(comparison, name)
    return f"{sentence} ({' or '.join(map(str, counts))} subjects, {test} 95 % intervals).{remarks}"


def _describe_remarks(comparison: pd.DataFrame, name: str) -> str:
    """How many estimates of each condition are remarked, where any are."""
    means = comparison[(comparison["parameter"] == name) & (comparison["kind"] == "mean")]
    if "remarked" not in means or not means["remarked"].any():
        return ""
    counts = [f"{row['remarked']:g} in {row['condition']}" for _, row in means.iterrows()]
    return f" Estimates that are remarked: {', '.join(counts)}; a shift in one condition alone is a difference."


def _describe_change(row: pd.Series) -> str:
    """A difference in words."""
    name, reference, condition = row["parameter"], row["reference"], row["condition"]
    if row["subjects"] == 0:
        return (
            f"no subject has {name} both in {reference} and in {condition} "
            "(groups of subjects are compared with between=)"
        )
    if pd.isna(row["low"]):
        return f"the difference of {name} from {reference} to {condition} cannot be judged: it needs two subjects"
    ends = [row["value"], row["low"], row["high"]]
    change = f"no difference of {name} is shown:"
    if row["low"] > 0:
        change = f"{name} rises by"
    elif row["high"] < 0:
        change = f"{name} falls by"
        ends = [-row["value"], -row["high"], -row["low"]]
    numbers = "{:.4g} ({:.4g} … {:.4g})".format(*ends)
    return f"{change} {numbers} {row['unit']} from {reference} to {condition}"
