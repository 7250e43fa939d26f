"""What an identification method is to its callers, and the options that several methods share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.options import Options, option

__all__ = ["Method", "Trial", "degree_option", "delay_option", "rate_option"]

Trial = xr.Dataset | PreparedTrial


def delay_option(description: str = "reflex delay", *, estimated: bool = False) -> Any:
    """Declare the reflex delay; a method that estimates it takes None."""
    return option(0.04, description + ("; null estimates it" if estimated else ""), unit="s", ge=0, le=1)


def rate_option() -> Any:
    """Declare the identification rate."""
    return option(100.0, "rate of the identification; the sampling rate has to be a multiple of it", unit="Hz", gt=0)


def degree_option() -> Any:
    """Declare the number of basis functions."""
    return option(5, "number of basis functions (the rectifier has one)", ge=1, le=30)


@dataclass(frozen=True)
class Method:
    """A method under its name.

    Calling it with a trial and options by name identifies; see `ankleloop.identify`.

    Parameters
    ----------
    name : str
        Its name.
    options : type of Options
        Its options.
    identify : callable
        ``identify(trial, options)`` gives the estimate of a prepared trial.
    merge : callable, optional
        ``merge(trials, options)`` merges several trials into one identification, and gives an estimate for each.
    """

    name: str
    options: type[Options]
    identify: Callable[[PreparedTrial, Any], Estimate]
    merge: Callable[[Sequence[PreparedTrial], Any], list[Estimate]] | None = None

    @property
    def merges(self) -> bool:
        """Whether it can merge several trials into one identification."""
        return self.merge is not None

    def __call__(self, trial: Trial | Sequence[Trial], **options: Any) -> Any:
        """Identify a trial, or a list of trials that are merged.

        Parameters
        ----------
        trial : xarray.Dataset or PreparedTrial, or list of those
            The trial.
        **options
            Options by name.

        Returns
        -------
        Estimate, or list of those
            One for each trial of a list.

        Raises
        ------
        TypeError, ValueError
            For an option that the method does not have, or a value out of its range.
        DataError
            For a trial that the method cannot use.
        """
        chosen = self.options.parse(f"method {self.name!r}", **options)
        if not isinstance(trial, (list, tuple)):
            return self.identify(prepare(cast(Trial, trial)), chosen)
        if self.merge is None:
            raise DataError(f"{self.name} identifies one trial at a time.")
        if not trial:
            raise DataError("there are no trials to merge.")
        return self.merge([prepare(part) for part in trial], chosen)
