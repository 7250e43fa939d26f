"""Channels of C3D files (force plates, motion capture) and of TDMS files (LabVIEW), by the libraries of the formats."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from ankleloop.signals.sampling import rate_of_interval
from ankleloop.trials.contents import Contents, Variable
from ankleloop.trials.files import UnreadableError


class C3dContents(Contents):
    """Analog channels of a C3D file, scaled, at the rate of these channels."""

    def __init__(self, path: Path) -> None:
        import ezc3d  # an extra

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


class TdmsContents(Contents):
    """Channels of the groups of a TDMS file, scaled, by the names `group/channel`."""

    def __init__(self, path: Path) -> None:
        import nptdms  # an extra

        super().__init__(path)
        intervals = set()
        self._file = nptdms.TdmsFile.open(path)
        if self._file.file_status.incomplete_final_segment:
            raise UnreadableError("its last segment is cut off")
        for group in self._file.groups():
            for channel in group.channels():
                intervals.add(channel.properties.get("wf_increment"))
                name = f"{group.name}/{channel.name}"
                attributes = {"units": channel.properties.get("unit_string", "")}
                read = partial(channel.__getitem__, slice(None))
                self.variables.append(Variable(name, (len(channel),), read, attributes))
        if len(intervals) == 1 and None not in intervals:
            self.file_attributes = {"sampling_rate": rate_of_interval(intervals.pop())}

    def close(self) -> None:
        """Close the file."""
        self._file.close()
