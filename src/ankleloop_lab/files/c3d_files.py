"""C3D files (force plates, motion capture): their analog channels."""

from __future__ import annotations

from pathlib import Path

import ezc3d
import numpy as np

from ankleloop.trials.files import UnreadableError
from ankleloop_lab.files.contents import Contents, Variable


class C3dContents(Contents):
    """Analog channels of a C3D file, scaled, at the rate of these channels."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        content = ezc3d.c3d(str(path))
        analog = content["parameters"]["ANALOG"]
        # The library reads a file that is cut off, and says nothing; its header has the first and the last frame.
        first, last = np.fromfile(path, "<u2", 2, offset=6).tolist()
        if content["parameters"]["POINT"]["FRAMES"]["value"][0] < last - first + 1:
            raise UnreadableError("it ends before its last frame")
        names = analog["LABELS"]["value"]
        units = analog["UNITS"]["value"] or [""] * len(names)
        for name, unit, row in zip(names, units, content["data"]["analogs"][0], strict=True):
            samples = np.array(row)
            attributes = {"units": unit.strip()}
            self.variables.append(Variable(name.strip(), row.shape, samples.view, attributes))
        self.file_attributes = {"sampling_rate": float(analog["RATE"]["value"][0])}
