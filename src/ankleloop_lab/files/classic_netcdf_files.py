"""Classic NetCDF files, which have no groups."""

from __future__ import annotations

from pathlib import Path

import scipy.io

from ankleloop_lab.files.contents import Contents, Variable


class ClassicNetcdfContents(Contents):
    """Variables of a classic NetCDF file, which has no groups."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        file = scipy.io.netcdf_file(path, "r", mmap=True, maskandscale=False)
        self.file_attributes = file._attributes
        for name, node in file.variables.items():
            samples = node.data
            variable = Variable(name, samples.shape, samples.view, node._attributes)
            self.variables.append(variable)
