"""The apparatus that a trial carries: what its torque is less of, and how well that is known."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any, Self

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.intervals import Uncertainty
from ankleloop.quantities import QUANTITIES, STIFFNESS

ATTRIBUTE = "apparatus"  # of a trial
# Of position, velocity, acceleration and the sign of the velocity, in this order.
APPARATUS = (*STIFFNESS, "friction")
SHOWN_DIGITS = "{:.3g}".format


@dataclass(frozen=True)
class Apparatus:
    """An apparatus as a trial carries it: numbers and not samples, whose noise would be that of the position."""

    source: str  # what the empty record is called
    values: Mapping[str, float]  # K, B, I and friction by their names
    covariance: Mapping[str, Mapping[str, float]]  # of those that were estimated

    @classmethod
    def carried_by(cls, trial: xr.Dataset) -> Self | None:
        """That of a trial; None where nothing was subtracted."""
        text = trial.attrs.get(ATTRIBUTE)
        if text is None:
            return None
        try:
            return cls(**json.loads(text))
        except (TypeError, ValueError):
            raise DataError(
                f"the attribute {ATTRIBUTE} of the trial is {text!r:.40}, which ankleloop.subtract has not written: "
                "give it another name."
            ) from None

    def dump(self) -> str:
        """The text that a trial holds."""
        return json.dumps(asdict(self))

    @cached_property
    def linear(self) -> np.ndarray:
        """Torque of a unit of each of its inputs, shape (4,)."""
        return np.array([self.values[name] for name in APPARATUS])

    @cached_property
    def scatter(self) -> np.ndarray:
        """Covariance of these, shape (4, 4); zero of what was not estimated."""
        rows = [self.covariance.get(name, {}) for name in APPARATUS]
        return np.array([[row.get(name, 0.0) for name in APPARATUS] for row in rows])

    @property
    def fingerprint(self) -> str:
        """What tells it from another one."""
        numbers = json.dumps([dict(self.values), self.covariance], sort_keys=True)
        return sha256(numbers.encode()).hexdigest()[:12]

    def __str__(self) -> str:
        numbers = [
            f"{QUANTITIES[name].symbol} {SHOWN_DIGITS(self.values[name])} {QUANTITIES[name].unit}"
            for name in ("I", "B", "K", "friction")
            if self.values[name]
        ]
        origin = f" of {self.source}" if self.source else ""
        return f"less the apparatus{origin}: {', '.join(numbers)}"

    def diagnostics(self, uncertainty: Uncertainty) -> dict[str, Any]:
        """Entry of the diagnostics of an estimate, with how uncertain its parameters are by the apparatus alone."""
        return {
            "apparatus": {
                "text": str(self),
                "source": self.source,
                "fingerprint": self.fingerprint,
                "values": dict(self.values),
                "standard_errors": uncertainty.standard_errors,
            }
        }
