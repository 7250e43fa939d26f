"""Options of `riv-tv`."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from ankleloop.methods.method import NOMINAL_DELAY, RectifierOptions, RefinedOptions
from ankleloop.options import as_plain, option

Knots = Annotated[int, Field(ge=1, le=200)]


class RivTvOptions(RefinedOptions, RectifierOptions):
    """Options of refined instrumental variables for joints that change in time."""

    delay: float | None = option(
        NOMINAL_DELAY, "reflex delay; null estimates it", unit="s", ge=0, le=1
    )
    cycle_onsets: tuple[float, ...] | tuple[tuple[float, ...], ...] | str | None = option(
        None,
        "start of every cycle, and end of the last one; or the variable that holds the phase, 0 to 1; of merged "
        "trials a sequence for each",
        unit="s",
    )
    schedule: str | None = option(
        None,
        "scheduling variable of the trial: K, B and G are functions of it; null without cycles: of time",
    )
    knots: tuple[Knots, Knots, Knots] = option(
        (12, 8, 12), "numbers of splines of K, B and G; penalties smooth them"
    )
    inertia_knots: Knots = option(
        1, "number of splines of I, of a posture or a limb that changes; 1 for a constant"
    )
    interpolation: Literal["cubic", "constant"] = option(
        "cubic",
        "cubic splines; or values that are constant over equal intervals, as of short segments",
    )
    torque_lag: float | None = option(
        0.0,
        "lag of the torque channel behind the position; null estimates it",
        unit="s",
        ge=-0.05,
        le=0.05,
    )
    rest_position: float | None = option(
        None,
        "position at which the elastic torque is zero; null: the mean position",
        unit="rad",
        ge=-10,
        le=10,
    )

    intervals: Literal["robust", "between trials"] | None = option(
        None,
        "of the means: robust; between trials, for the mean over all such trials; null: as the record shows",
    )

    @field_validator("cycle_onsets", "knots", mode="before")
    @classmethod
    def _as_tuple(cls, values: Any) -> Any:
        """Numbers come as lists from YAML, as arrays from NumPy, and as a text with commas from a table."""
        if isinstance(values, str) and "," in values:
            values = values.split(",")
            return tuple(int(part) if part.strip().isdigit() else float(part) for part in values)
        if hasattr(values, "__array__"):
            values = np.asarray(values)
        if isinstance(values, (list, tuple, np.ndarray)):
            return tuple(
                cls._as_tuple(part) if np.ndim(part) else as_plain(part) for part in values
            )
        return values

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.interpolation == "cubic" and (min(self.knots) < 4 or 1 < self.inertia_knots < 4):
            raise ValueError(
                f"knots of cubic splines must be at least 4, got {self.knots} and {self.inertia_knots}."
            )
        if self.cycle_onsets is not None and self.schedule is not None:
            raise ValueError(
                "cycle_onsets and schedule exclude each other: K, B and G are functions of one of them."
            )
        return self
