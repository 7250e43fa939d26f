"""TDMS files of LabVIEW."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import nptdms

from ankleloop.signals.sampling import rate_of_interval
from ankleloop.trials.files import UnreadableError
from ankleloop_lab.files.contents import Contents, Variable


class TdmsContents(Contents):
    """Channels of the groups of a TDMS file, scaled, by the names `group/channel`."""

    def __init__(self, path: Path) -> None:
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
