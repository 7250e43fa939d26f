"""MATLAB files of all versions."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import h5py
import numpy as np
from matio import load_from_mat, whosmat

from ankleloop.trials.readable_files import check_place
from ankleloop_lab.files.contents import Contents, Variable
from ankleloop_lab.files.matlab_values import load_parts

# Classes whose variables are read when they are asked for.
NUMBERS = {"double", "single", "logical", "char", "int8", "int16", "int32", "int64"}
NUMBERS |= {"uint8", "uint16", "uint32", "uint64"}


class MatContents(Contents):
    """Variables of a MATLAB file; arrays of numbers are read when they are asked for."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        if h5py.is_hdf5(path):  # v7.3, where mat-io reads samples in other files as zeros
            with h5py.File(path, "r") as file:
                file.visititems(partial(check_place, path))
        for name, (shape, kind) in whosmat(path).items():
            if str(kind).removeprefix("complex ") in NUMBERS:
                self.variables.append(Variable(name, shape, partial(self._read, name)))
            else:
                self.variables += load_parts(path, name)

    def _read(self, name: str) -> np.ndarray:
        samples: np.ndarray = load_from_mat(self.path, variable_names=[name])[name]
        return samples
