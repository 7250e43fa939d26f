"""What studies of simulations and of recordings have in common."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

from ankleloop.studies.config import MethodSettings, RecordingsStudy, SimulationStudy


class Study(ABC):
    """A study under its name.

    Parameters
    ----------
    name : str
        Its name.
    settings : SimulationStudy or RecordingsStudy
        Its part of the configuration.
    """

    settings: SimulationStudy | RecordingsStudy

    def __init__(self, name: str, settings: SimulationStudy | RecordingsStudy) -> None:
        self.name = name
        self.settings = settings

    @property
    def kind(self) -> str:
        """Source of its trials, "simulation" or "recordings"."""
        return self.settings.kind

    @property
    def title(self) -> str:
        """Heading of its report; its name where the configuration has none."""
        words = re.sub("[_-]+", " ", self.name).strip()
        return self.settings.title or words[:1].upper() + words[1:]

    @property
    def methods(self) -> Mapping[str, MethodSettings]:
        """Methods by the name that tables use."""
        return self.settings.methods

    @property
    def labels(self) -> dict[str, str]:
        """Legend of each method."""
        return {name: method.label or name for name, method in self.methods.items()}

    @property
    def algorithms(self) -> dict[str, str]:
        """Name in the registry of each method."""
        return {name: method.method for name, method in self.methods.items()}

    @property
    @abstractmethod
    def points(self) -> dict[str, dict[str, Any]]:
        """Settings of each point, or mapping of each recording, by name."""

    @property
    @abstractmethod
    def chunks(self) -> Sequence[Sequence[Any]]:
        """Contents of each chunk."""

    @property
    def varied(self) -> list[str]:
        """Names of the settings that differ between the points."""
        return []
