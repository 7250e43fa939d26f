"""Axes of pictures of a sweep: numbers on a linear or logarithmic axis, or a list of values."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

MOST_LISTED = 12  # distinct values that are drawn one by one; more are drawn in bins
BINS = 10
LABEL = 30  # characters of a line of a label
DIGITS = ((1.0, 2.0, 5.0), (1.0, 3.0))  # that have a label in each decade, by the room that there is
LEAST_DECADE = 5.0  # largest over smallest value, from which on an axis may be logarithmic
NARROWEST = 0.25  # smallest over mean distance of neighbours; closer ones are listed, so that all can be read


@dataclass(frozen=True)
class SweepAxis:
    """Axis of a varied parameter."""

    name: str  # column of the parameter
    label: str  # its name with unit
    # Its distinct values: numbers in their order, then None, flags and texts as the points have them.
    values: tuple[Any, ...]
    words: Mapping[Any, str] = field(default_factory=dict)  # words for values that are no numbers, where they have any

    @classmethod
    def of(cls, name: str, label: str, values: Iterable[Any], words: Mapping[Any, str] | None = None) -> SweepAxis:
        """Axis for the values of all points; nan stands for None, as in tables."""
        distinct = dict.fromkeys(map(_as_value, values))
        numbers = sorted(value for value in distinct if _is_number(value))
        return cls(name, label, (*numbers, *(value for value in distinct if not _is_number(value))), words or {})

    @property
    def ordered(self) -> bool:
        """Whether a line may join neighbours: all values are numbers."""
        return all(map(_is_number, self.values))

    @cached_property
    def kind(self) -> Literal["linear", "log", "listed"]:
        """Scale: values that are spaced neither linearly nor logarithmically, or are no numbers, are listed."""
        if not self.ordered:
            return "listed"
        numbers = np.array(self.values, dtype=float)
        if numbers.size < 3:
            return "linear"
        logarithmic = False
        if numbers[0] > 0 and numbers[-1] / numbers[0] >= LEAST_DECADE:
            logarithmic = _unevenness(np.log(numbers)) < _unevenness(numbers)
        gaps = np.diff(np.log(numbers) if logarithmic else numbers)
        if gaps.min() < NARROWEST * gaps.mean() and numbers.size <= MOST_LISTED:
            return "listed"
        return "log" if logarithmic else "linear"

    @property
    def description(self) -> str:
        """The label without its unit."""
        return self.label.partition(" [")[0]

    @property
    def unit(self) -> str:
        """The unit; empty for numbers without one."""
        return self.label.rstrip("]").partition(" [")[2].removesuffix("1")

    @property
    def heading(self) -> str:
        """The label, without the unit of what has none."""
        return self.label.removesuffix(" [1]")

    @property
    def texts(self) -> list[str]:
        """Values as words."""
        return [self.format(value) for value in self.values]

    def format(self, value: Any) -> str:
        """A value as a word."""
        value = _as_value(value)
        standard = {None: "none", True: "true", False: "false"}
        return f"{value:.4g}" if _is_number(value) else self.words.get(value) or standard.get(value) or str(value)

    def describe(self, value: Any) -> str:
        """A value with name and unit, such as "block rows 12 samples"."""
        unit = self.unit if _is_number(_as_value(value)) else ""
        return f"{self.description} {self.format(value)} {unit}".rstrip()

    def numbers(self, values: Iterable[Any]) -> np.ndarray:
        """Numbers of values in the list of all."""
        numbers = {value: number for number, value in enumerate(self.values)}
        return np.array([numbers[_as_value(value)] for value in values], dtype=int)

    def places(self, values: Iterable[Any]) -> np.ndarray:
        """Places of values on the axis: the values themselves, or their numbers in the list."""
        return self.numbers(values) if self.kind == "listed" else np.asarray(list(values), dtype=float)

    def bin(self, values: pd.Series, most: int = MOST_LISTED, count: int = BINS) -> pd.Series:
        """Replace many different numbers by the medians of bins with as many points each; few values stay."""
        if self.kind == "listed" or len(self.values) <= most:
            return values
        bins = pd.qcut(values, min(count, len(self.values)), labels=False, duplicates="drop")
        return values.groupby(bins).transform("median")

    def set_ticks(self, axes: Axes, direction: Literal["x", "y"], room: int, *, listed: bool = False) -> None:
        """Set scale, label and ticks of an axis of a panel, which lists all values, or those without a scale."""
        axis = axes.xaxis if direction == "x" else axes.yaxis
        axis.set_label_text(textwrap.fill(self.label if self.ordered else self.heading, max(5 * room, LABEL)))
        if listed or self.kind == "listed":
            texts = self.texts[:: -(-len(self.values) // room)]
            axis.set_ticks(range(0, len(self.values), -(-len(self.values) // room)), texts)
            pitch = 8 * room // len(texts)  # characters of two neighbours on an abscissa
            if direction == "x" and any(len(first + second) > pitch for first, second in pairwise(texts)):
                axis.set_tick_params(rotation=35)
            return
        axes.set(**{f"{direction}scale": self.kind})
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
        if len(self.values) <= room and len("".join(self.texts)) <= 4 * room:
            axis.set_ticks(self.values, self.texts)
            axis.set_ticks([], minor=True)
        elif self.kind == "log":
            decades = np.log10(self.values[-1] / self.values[0])
            digits = next((digits for digits in DIGITS if len(digits) * decades < room), (1.0,))
            axis.set_major_locator(LogLocator(subs=digits))
        else:
            axes.locator_params(axis=direction, nbins=min(room, 6))


def _unevenness(numbers: np.ndarray) -> float:
    """Largest distance of sorted numbers from even spacing, as a share of their range."""
    even = np.linspace(numbers[0], numbers[-1], numbers.size)
    return float(np.abs(numbers - even).max() / (numbers[-1] - numbers[0]))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _as_value(value: Any) -> Any:
    """A value of a table as the configuration has it: nan is None, numbers of numpy are numbers."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if value is None or value != value else value  # nan
