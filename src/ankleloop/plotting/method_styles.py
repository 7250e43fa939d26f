"""Colour, marker and line of each method: the same in every picture, static or interactive."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

Dashes = tuple[float, ...]


@dataclass(frozen=True)
class MethodStyle:
    """How a method, or another series, is drawn."""

    colour: str  # of lines and symbols, as "#rrggbb"
    marker: str  # symbol, as matplotlib names it
    filled: bool = True  # whether the symbol is filled
    dashes: Dashes = ()  # lengths of dashes and gaps in line widths; empty for a solid line

    @property
    def symbol(self) -> dict[str, Any]:
        """Properties of its symbols for matplotlib."""
        face = self.colour if self.filled else "white"
        return {"color": self.colour, "marker": self.marker, "markerfacecolor": face}

    @property
    def line(self) -> dict[str, Any]:
        """Properties of a line without symbols for matplotlib."""
        return {"color": self.colour, "linestyle": (0, self.dashes) if self.dashes else "-"}

    @property
    def curve(self) -> dict[str, Any]:
        """Properties of a line with symbols for matplotlib."""
        return {**self.symbol, **self.line}


# Five of Okabe and Ito's colours and four that differ from them for readers without red or green receptors, too. The
# colours also differ in lightness where their hues are near; no two methods share a symbol.
METHOD_STYLES: Mapping[str, MethodStyle] = {
    "pr-moesp": MethodStyle("#0072B2", "o"),
    "eiv-moesp": MethodStyle("#D55E00", "s"),
    "pi-moesp": MethodStyle("#E69F00", "v"),
    "po-moesp": MethodStyle("#56B4E9", "<"),
    "moesp": MethodStyle("#5533CC", ">"),
    "parallel-cascade": MethodStyle("#009E73", "^"),
    "real-time": MethodStyle("#CC79A7", "X"),
    "riv": MethodStyle("#882255", "D"),
    "riv-tv": MethodStyle("#B22222", "p"),
}
# Of methods that the registry has but the table above does not, such as a new one.
SPARE_STYLES = (MethodStyle("#555555", "P"), MethodStyle("#332288", "h"), MethodStyle("#661100", "*"))

# Change of lightness, fill and line of the variants of a method: they keep its colour and its symbol.
VARIANTS: tuple[tuple[float, bool, Dashes], ...] = (
    (0.0, True, ()),
    (-0.35, False, (4.0, 1.5)),
    (0.4, True, (6.0, 1.5, 1.0, 1.5)),
    (-0.35, True, (1.0, 1.5)),
    (0.4, False, (8.0, 2.0)),
    (0.0, False, (6.0, 1.5, 1.0, 1.5, 1.0, 1.5)),
)
MOST_VARIANTS = 3  # of a single method that are drawn in its colour
# Variants that several studies have; they are drawn alike in all of them.
NAMED_VARIANTS = {
    "parallel-cascade-one-pass": 1,
    "parallel-cascade-two-passes": 2,
    "pr-moesp-instruments": 1,
    "pr-moesp-free-b": 2,
    "riv-delay": 1,
    "riv-chebyshev": 2,
    "riv-tv-least-squares": 1,
    "riv-tv-segments": 2,
}
# From dark to light: values of a parameter, subjects.
ORDINAL_COLOURS = ("#1B1044", "#3B4A8C", "#2A788E", "#1F9E77", "#62B244", "#DDBE00")
ORDINAL_MARKERS = "os^Dv<>pX"


def method_styles(algorithms: Mapping[str, str]) -> dict[str, MethodStyle]:
    """Styles of the methods of a study.

    A method has the same colour and symbol in every study. Where a study has it with several sets of options, these
    variants differ in lightness, fill and line. Many variants of a single method go from dark to light instead: there
    the colour does not have to tell the method.
    """
    if len(algorithms) > MOST_VARIANTS and len(set(algorithms.values())) == 1:
        return ordinal_styles(algorithms)
    spare = [name for name in dict.fromkeys(algorithms.values()) if name not in METHOD_STYLES]
    base = {**METHOD_STYLES, **{name: SPARE_STYLES[n % len(SPARE_STYLES)] for n, name in enumerate(spare)}}
    variants = {key: 0 if key == name else NAMED_VARIANTS.get(key) for key, name in algorithms.items()}
    styles = {}
    for key, name in algorithms.items():
        number = variants[key]
        if number is None:
            used = {variants[other] for other, method in algorithms.items() if method == name}
            number = next(n for n in range(len(algorithms) + len(VARIANTS)) if n not in used)
            variants[key] = number
        styles[key] = _vary(base[name], number)
    return styles


def _vary(style: MethodStyle, number: int) -> MethodStyle:
    change, filled, dashes = VARIANTS[number % len(VARIANTS)]
    return replace(style, colour=_lighten(style.colour, change), filled=filled, dashes=dashes)


def _lighten(colour: str, share: float) -> str:
    """A colour mixed with white, or with black where the share is negative."""
    target = 255 if share > 0 else 0
    parts = (int(colour[start : start + 2], 16) for start in (1, 3, 5))
    return "#" + "".join(f"{round(part + abs(share) * (target - part)):02X}" for part in parts)


def ordinal_styles(names: Iterable[str]) -> dict[str, MethodStyle]:
    """Styles of series that are no methods, such as values of a parameter: from dark to light."""
    names = list(names)
    last = len(ORDINAL_COLOURS) - 1
    places = [
        round(number * last / max(1, len(names) - 1)) if len(names) > 3 else 2 * number for number in range(len(names))
    ]
    return {
        name: MethodStyle(ORDINAL_COLOURS[place], ORDINAL_MARKERS[number % len(ORDINAL_MARKERS)])
        for number, (name, place) in enumerate(zip(names, places, strict=True))
    }


def label_styles(labels: Mapping[str, str], algorithms: Mapping[str, str]) -> dict[str, MethodStyle]:
    """Styles of the methods of a study by their labels."""
    styles = method_styles({name: algorithms.get(name, name) for name in labels})
    return {label: styles[name] for name, label in labels.items()}
