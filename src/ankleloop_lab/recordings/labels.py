"""Labels of recordings, such as subject and condition, that the names of their files hold."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from ankleloop.errors import DataError
from ankleloop.trials.files import PathLike

GROUPS = ("subject", "condition", "trial", "session")
PLACE = re.compile(r"\{(.*?)\}")  # of a label in a pattern
WORD = re.compile(r"[^_\s-]+")  # of a name


def read_labels(path: PathLike, pattern: str) -> dict[str, str]:
    """Labels that the name of a file holds, without its suffix, by a pattern.

    Parameters
    ----------
    path : path-like
        The file. Of its folders as many count as the pattern has.
    pattern : str
        The name with labels in braces.

    Returns
    -------
    dict of str to str

    Raises
    ------
    DataError
        If the pattern has no label, or one twice, or the name is another one.

    Examples
    --------
    >>> read_labels("data/S1_rest.mat", "{subject}_{condition}")
    {'subject': 'S1', 'condition': 'rest'}
    >>> read_labels("data/S1/10MVC-2.csv.gz", "{subject}/{condition}-{trial}")
    {'subject': 'S1', 'condition': '10MVC', 'trial': '2'}
    """
    labels = PLACE.findall(pattern)
    is_usable = all(map(str.isidentifier, labels)) and len(set(labels)) == len(labels)
    if not labels or not is_usable:
        raise DataError(
            f"the names {pattern!r}: write the labels in braces, each once, as in {{subject}}_{{condition}}."
        )
    parts = PLACE.split(pattern)  # what stands between labels, and labels, in turn
    expression = ""
    for number, part in enumerate(parts):
        expression += f"(?P<{part}>[^/]+?)" if number % 2 else re.escape(part)
    name = _list_parts(path)
    shown = "/".join(name[-1 - pattern.count("/") :])
    match = re.fullmatch(expression, shown)
    if match is None:
        raise DataError(
            f"{path}: its name {shown!r} has not the form {pattern!r}: give another pattern, or rename the file."
        )
    return match.groupdict()


def _list_parts(path: PathLike) -> list[str]:
    """Folders of a file, and its name without its suffix."""
    file = Path(path)
    return [*file.parts[:-1], Path(file.name.removesuffix(".gz")).stem]


def suggest_names(paths: Iterable[PathLike]) -> str | None:
    """Pattern of subject, condition and repetition that the names of some files suggest; None if they suggest none.

    The names have as many parts; those that differ are the labels, in this order.

    >>> suggest_names(["pre_S1_rest.mat", "pre_S1_10MVC.mat", "pre_S2_rest.mat", "pre_S2_10MVC.mat"])
    'pre_{subject}_{condition}'
    """
    names = [_list_parts(path)[-1] for path in paths]
    if len({WORD.sub("", name) for name in names}) != 1:  # other separators
        return None
    columns = zip(*map(WORD.findall, names), strict=True)
    varied = [len(set(column)) > 1 for column in columns]
    if not 2 <= sum(varied) <= len(GROUPS):
        return None
    labels = iter(GROUPS)
    is_label = iter(varied)
    return WORD.sub(lambda word: f"{{{next(labels)}}}" if next(is_label) else word[0], names[0])


def order_conditions(conditions: Sequence[object]) -> list[object]:
    """Conditions by the numbers in them, those without one first; without any number in the order of appearance.

    >>> order_conditions(["10MVC", "20MVC", "rest"])
    ['rest', '10MVC', '20MVC']
    >>> order_conditions(["0deg", "10deg", "-10deg"])
    ['-10deg', '0deg', '10deg']
    """
    return sorted(dict.fromkeys(conditions), key=_find_number)


def _find_number(condition: object) -> float:
    """The first number in a condition; a sign behind a letter or a digit, as in MVC-10, divides words."""
    match = re.search(r"((?<!\w)[-−])?\d+(\.\d+)?", str(condition))
    return float(match[0].replace("−", "-")) if match else float("-inf")
