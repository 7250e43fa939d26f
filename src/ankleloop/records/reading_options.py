"""Options that map the variables of a file to the channels of a trial."""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import field_validator

from ankleloop.options import Options, option

__all__ = ["ReadingOptions"]


class ReadingOptions(Options):
    """How the variables of a file become the channels of a trial: their names, units and signs.

    Examples
    --------
    >>> options = ReadingOptions.parse("trial.mat", position="angle", position_unit="deg", torque_sign=-1)
    >>> options.variables, options.factor("torque")
    ({'position': 'angle', 'torque': 'torque'}, -1.0)
    """

    position: str = option("position", "name of the position variable in the file")
    torque: str = option("torque", "name of the torque variable in the file")
    reference: str | None = option(None, "name of the command of the servo in the file; null where it was not recorded")
    sampling_rate: float | None = option(None, "sampling rate; null takes it from the file", unit="Hz", gt=0)
    position_unit: Literal["rad", "deg"] = option("rad", "unit of position and reference in the file")
    position_sign: Literal[1, -1] = option(1, "-1 turns position and reference round")
    torque_sign: Literal[1, -1] = option(1, "-1 turns the torque round, so that it opposes stretch (positive K, B, I)")

    @field_validator("position_sign", "torque_sign", mode="before")
    @classmethod
    def _as_integer(cls, sign: Any) -> Any:
        """Signs from tables are often floating-point numbers."""
        return int(sign) if isinstance(sign, int | float) and sign in (1, -1) else sign

    @property
    def variables(self) -> dict[str, str]:
        """Names of the variables in the file by channel; the reference only where it was recorded."""
        names = {"position": self.position, "torque": self.torque, "reference": self.reference}
        return {channel: name for channel, name in names.items() if name is not None}

    def factor(self, channel: str) -> float:
        """Compute the factor that brings the numbers of the file to rad and N·m, with the sign of the convention.

        Parameters
        ----------
        channel : str
            `position`, `reference`, `torque` or the name of a true torque, which begins with `torque`.

        Returns
        -------
        float

        Examples
        --------
        >>> ReadingOptions(position_unit="deg").factor("position") * 180
        3.141592653589793
        """
        if channel.startswith("torque"):
            return float(self.torque_sign)
        return self.position_sign * (math.pi / 180.0 if self.position_unit == "deg" else 1.0)
