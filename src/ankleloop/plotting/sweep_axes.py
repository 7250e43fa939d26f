"""Axes of pictures of a sweep: numbers on a linear or logarithmic axis, or a list of values; ticks, cells and bins."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike

MOST_LISTED = 12  # distinct values that are drawn one by one; more are drawn in bins
MOST_TICKS = 8  # values that all have a label of their own
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

    @cached_property
    def kind(self) -> Literal["linear", "log", "listed"]:
        """Scale: values that are spaced neither linearly nor logarithmically, or are no numbers, are listed."""
        if not all(map(_is_number, self.values)):
            return "listed"
        if len(self.values) < 3:
            return "linear"
        numbers = np.array(self.values, dtype=float)
        logarithmic = False
        if numbers[0] > 0 and numbers[-1] / numbers[0] >= LEAST_DECADE:
            logarithmic = _unevenness(np.log(numbers)) < _unevenness(numbers)
        gaps = np.diff(np.log(numbers) if logarithmic else numbers)
        if gaps.min() < NARROWEST * gaps.mean() and len(numbers) <= MOST_LISTED:
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
    def texts(self) -> list[str]:
        """Values as words."""
        return [self._format(value) for value in self.values]

    @property
    def ordered(self) -> bool:
        """Whether a line may join neighbours: all values are numbers."""
        return all(map(_is_number, self.values))

    def describe(self, value: Any) -> str:
        """A value with name and unit, such as "block rows 12 samples"."""
        value = _as_value(value)
        unit = self.unit if _is_number(value) else ""
        return f"{self.description} {self._format(value)} {unit}".rstrip()

    def places(self, values: Iterable[Any]) -> np.ndarray:
        """Places of values on the axis: the values themselves, or their numbers in the list."""
        if self.kind != "listed":
            return np.asarray(list(values), dtype=float)
        numbers = {value: number for number, value in enumerate(self.values)}
        return np.array([numbers[_as_value(value)] for value in values], dtype=float)

    def value_at(self, place: float) -> Any:
        """The value at a place: the number itself, or what stands there in the list."""
        return self.texts[round(place)] if self.kind == "listed" else float(place)

    def edges(self) -> np.ndarray:
        """Edges of the cells around all values: halfway between neighbours, on the scale of the axis."""
        places = self._scale(self.places(self.values))
        if places.size == 1:
            return self._unscale(places[0] + np.array([-0.5, 0.5]))
        middles = (places[1:] + places[:-1]) / 2
        return self._unscale(np.r_[2 * places[0] - middles[0], middles, 2 * places[-1] - middles[-1]])

    def bin(self, values: Iterable[Any], count: int = BINS, most: int = MOST_LISTED) -> tuple[np.ndarray, np.ndarray]:
        """Divide values into bins of equal width on the scale of the axis, or by value where there are few of them."""
        if self.kind == "listed" or len(self.values) <= most:
            return self.places(values), self.edges()
        first, last = self._scale([self.values[0], self.values[-1]])
        edges = np.linspace(first, last, count + 1)
        numbers = np.digitize(self._scale(self.places(values)), edges) - 1
        centres = (edges[1:] + edges[:-1]) / 2
        return self._unscale(centres)[np.clip(numbers, 0, count - 1)], self._unscale(edges)

    def set_ticks(self, axes: Axes, direction: Literal["x", "y"], room: int = MOST_TICKS) -> None:
        """Set scale, label and ticks of an axis of a panel."""
        axis = axes.xaxis if direction == "x" else axes.yaxis
        label = self.label if self.ordered else self.label.removesuffix(" [1]")
        axis.set_label_text(textwrap.fill(label, LABEL if direction == "y" else max(5 * room, LABEL)))
        if self.kind == "listed":
            self._list_ticks(axis, direction, room)
            return
        if direction == "x":
            axes.set_xscale(self.kind)
        else:
            axes.set_yscale(self.kind)
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
        if len(self.values) <= room and (len("".join(self.texts)) <= 4 * room or direction == "y"):
            axis.set_ticks(self.places(self.values), self.texts)
            axis.set_ticks([], minor=True)
        elif self.kind == "log":
            decades = np.log10(self.values[-1] / self.values[0])
            digits = next((digits for digits in DIGITS if len(digits) * decades < room), (1.0,))
            axis.set_major_locator(LogLocator(subs=digits))
        else:
            axes.locator_params(axis=direction, nbins=min(room, 6))

    def _list_ticks(self, axis: Axis, direction: str, room: int) -> None:
        """Ticks at listed values; long texts on an abscissa have several lines, or are turned."""
        step = -(-len(self.values) // room)
        texts = self.texts[::step]
        pitch = 4 * room // len(texts)  # characters between neighbours on an abscissa
        if direction == "x":
            texts = [textwrap.fill(text, pitch, break_long_words=False) for text in texts]
        axis.set_ticks(range(0, len(self.values), step), texts)
        widths = [max(map(len, text.splitlines())) for text in texts]
        if direction == "x" and any(first + second > 2 * pitch for first, second in pairwise(widths)):
            for label in axis.get_ticklabels():
                label.set(rotation=35, ha="right", rotation_mode="anchor")

    def _format(self, value: Any) -> str:
        if _is_number(value):
            return f"{value:.4g}"
        standard = {None: "none", True: "true", False: "false"}
        return self.words.get(value) or standard.get(value) or str(value)

    def _scale(self, places: ArrayLike) -> np.ndarray:
        return np.log(places) if self.kind == "log" else np.asarray(places, dtype=float)

    def _unscale(self, values: ArrayLike) -> np.ndarray:
        return np.exp(values) if self.kind == "log" else np.asarray(values, dtype=float)


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
