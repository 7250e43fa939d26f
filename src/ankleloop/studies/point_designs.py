"""Ranges of values, and random designs of points."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from ankleloop.options import Options, option, show_value
from ankleloop.studies.checking import ConfigError, check
from ankleloop.studies.point_parameters import Parameter

MAX_POINTS = 100_000  # of a study
DIGITS = 12  # of the values of a range, so that 3 · 0.1 is 0.3; those of a design have half of them


class ValueRange(Options):
    """Values between two limits, both of which belong to them."""

    start: float = option(description="first value")
    stop: float = option(description="last value, where the step leads to it")
    step: float | None = option(None, "difference between neighbours", gt=0)
    count: int | None = option(None, "number of values, in place of a step", ge=2, le=MAX_POINTS)
    scale: Literal["linear", "logarithmic"] = option("linear", "equal differences, or equal ratios, of neighbours")

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        _check_limits(self.start, self.stop, self.scale)
        if (self.step is None) == (self.count is None):
            raise ValueError("has start, stop, and either step or count")
        if self.step is not None and self.scale == "logarithmic":
            raise ValueError("a logarithmic range has a count in place of a step")
        if self.step is not None and (self.stop - self.start) / self.step >= MAX_POINTS:
            raise ValueError(f"has more than {MAX_POINTS:,} values: use a larger step")
        return self

    @property
    def values(self) -> list[float]:
        """The values, rounded to 12 significant digits."""
        if self.step is not None:
            count = math.floor((self.stop - self.start) / self.step * (1 + 1e-12) + 1e-9) + 1
            values = [self.start + k * self.step for k in range(count)]
            # A difference such as 0.3 - 0.1 · 3 is 0, not 5e-17.
            return [0.0 if abs(v) < 1e-12 * self.step else _round(v) for v in values]
        last = (self.count or 2) - 1
        return [_round(_interpolate(self.start, self.stop, k / last, self.scale)) for k in range(last + 1)]


class Interval(Options):
    """Limits between which a design draws a parameter."""

    start: float = option(description="lower limit")
    stop: float = option(description="upper limit")
    scale: Literal["linear", "logarithmic"] = option("linear", "uniform in the value, or in its logarithm")

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        _check_limits(self.start, self.stop, self.scale)
        if self.start == self.stop:
            raise ValueError(f"stop must be above start, got {self.stop:g}")
        return self


class Design(Options):
    """A random design: points that fill the space of several parameters evenly."""

    design: Literal["latin-hypercube", "sobol"] = option(description="kind of the design")
    count: int = option(description="number of points; a power of two for sobol", ge=1, le=MAX_POINTS)
    seed: int = option(description="seed of the design", ge=0)
    parameters: dict[str, Any] = Field(
        description="limits (start, stop, scale) of each parameter, or the list of its values", min_length=1
    )

    @model_validator(mode="after")
    def _check_count(self) -> Self:
        power = 1 << self.count.bit_length() - 1
        if self.design == "sobol" and self.count != power:
            larger = f" or {2 * power}" if 2 * power <= MAX_POINTS else ""
            raise ValueError(
                f"the count of a Sobol design is a power of two, which fills space evenly: {power}{larger}, "
                f"got {self.count}; latin-hypercube takes any count"
            )
        return self


def list_values(parameter: Parameter, values: Any, place: tuple[str, ...]) -> list[Any]:
    """Values of a parameter of a grid."""
    if isinstance(values, Mapping):
        _check_number(parameter, place)
        value_range: ValueRange = check(ValueRange, values, "config", *place, parameter.column)
        listed: list[Any] = value_range.values
        # A count need not hit whole numbers; a step that does not is a mistake, which the model of the option refuses.
        return [round(v) for v in listed] if parameter.is_integer and value_range.count else listed
    if not isinstance(values, list) or not values:
        raise ConfigError(
            f"{' → '.join(('config', *place))}: each setting must have a list of values, or a range (start, stop, step "
            f"or count), got {parameter.column}: {show_value(values)}.",
            place,
        )
    return values


def draw_points(design: Design, parameters: Mapping[str, Parameter], place: tuple[str, ...]) -> list[dict[str, Any]]:
    """Points of a random design."""
    import numpy as np
    from scipy.stats import qmc

    columns = [_scale(parameters[name], values, place) for name, values in design.parameters.items()]
    if design.design == "sobol":
        sampler: Any = qmc.Sobol(len(columns), scramble=True, rng=np.random.default_rng(design.seed))
    else:
        sampler = qmc.LatinHypercube(len(columns), rng=np.random.default_rng(design.seed))
    numbers = sampler.random(design.count)
    names = list(design.parameters)
    return [{name: column(u) for name, column, u in zip(names, columns, row, strict=True)} for row in numbers.tolist()]


def _scale(parameter: Parameter, values: Any, place: tuple[str, ...]) -> Any:
    """Function from the unit interval to the values of a parameter."""
    if isinstance(values, list) and values:
        return lambda u: values[min(int(u * len(values)), len(values) - 1)]
    if not isinstance(values, Mapping):
        raise ConfigError(
            f"{' → '.join(('config', *place, 'parameters'))}: each parameter must have limits (start, stop) or a list "
            f"of values, got {parameter.column}: {show_value(values)}.",
            place,
        )
    _check_number(parameter, (*place, "parameters"))
    interval: Interval = check(Interval, values, "config", *place, "parameters", parameter.column)
    start, stop, scale = interval.start, interval.stop, interval.scale
    if parameter.is_integer and scale == "linear":  # each whole number from start to stop has the same share
        low, high = math.ceil(start), math.floor(stop)
        return lambda u: min(low + int(u * (high - low + 1)), high)
    if parameter.is_integer:
        return lambda u: round(_interpolate(start, stop, u, scale))
    return lambda u: _round(_interpolate(start, stop, u, scale), DIGITS // 2)


def _check_limits(start: float, stop: float, scale: str) -> None:
    if stop < start:
        raise ValueError(f"stop must be at least start ({start:g}), got {stop:g}: values are in ascending order")
    if scale == "logarithmic" and start <= 0:
        raise ValueError(f"a logarithmic scale begins above 0, got start: {start:g}; a linear one may hold 0")


def _check_number(parameter: Parameter, place: tuple[str, ...]) -> None:
    if not parameter.is_number:
        raise ConfigError(
            f"{' → '.join(('config', *place, parameter.column))}: is no number and has no range: list its values.",
            (*place, parameter.column),
        )


def _interpolate(start: float, stop: float, share: float, scale: str) -> float:
    if share in (0.0, 1.0):
        return stop if share else start
    return start * (stop / start) ** share if scale == "logarithmic" else start + (stop - start) * share


def _round(value: float, digits: int = DIGITS) -> float:
    return float(f"{value:.{digits}g}") + 0.0
