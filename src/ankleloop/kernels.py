"""Compiled functions, whose machine code is kept in files that many jobs may write at a time."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

import numpy as np
from numba import njit
from numba.core.caching import FunctionCache, IndexDataCacheFile

NO_FOLDER = (
    "neither the folder of ankleloop nor the home of this user can be written, so each process compiles its "
    "kernels again, which takes some seconds: name a folder of yours by the environment variable NUMBA_CACHE_DIR."
)

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(**options: Any) -> Callable[[Function], Function]:
    """Decorator that compiles a function by numba and keeps the machine code for other processes.

    The files are where numba has them: in the folder that `NUMBA_CACHE_DIR` names, beside the module, or in the home of
    the user. Where none of these can be written, each process compiles. A file that is damaged, or that cannot be
    written, is no error: the function is compiled.
    """

    def compile_function(function: Function) -> Function:
        compiled = njit(**options)(function)
        try:
            compiled._cache = _KernelCache(function)
        except RuntimeError:  # of numba, that no folder can be written
            warnings.warn(NO_FOLDER, stacklevel=1)  # from here, so that Python shows it once
        return compiled

    return compile_function


def as_samples(x: np.ndarray) -> np.ndarray:
    """Contiguous samples that cannot be edited: of one type for compiled functions, whoever may edit `x`."""
    samples = np.ascontiguousarray(x).view()
    samples.flags.writeable = False
    return samples


class _KernelCache(FunctionCache):
    """Cache of numba in which a file that cannot be read or written is one that is not there."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        locator = self._impl.locator
        self._cache_file = _KernelFiles(
            locator.get_cache_path(), self._impl.filename_base, locator.get_source_stamp()
        )

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Compiled code of a signature; None where there is none that can be read."""
        try:
            return super().load_overload(signature, target)
        except Exception:  # unpickling a damaged file raises errors of any kind
            return None

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep the compiled code of a signature, where its folder can be written."""
        with suppress(OSError):
            super().save_overload(signature, data)


class _KernelFiles(IndexDataCacheFile):
    """Files of a kernel, each named by what is in it.

    numba numbers the files of a function, and writes the number into its index before the file. Two jobs that compile
    it at once, for other types of arguments or on nodes of other processors, then take the same number, and the index
    may name the code of the other one. Here an index that is overwritten only forgets an entry.
    """

    def save(self, key: Any, data: Any) -> None:
        """Write the code, and then the index that names it."""
        content = repr((self._version, self._source_stamp, key))
        name = self._data_name_pattern.format(
            number=int(hashlib.sha256(content.encode()).hexdigest()[:15], 16)
        )
        self._save_data(name, data)
        try:
            names = self._load_index()
        except Exception:  # damaged
            names = {}
        self._save_index(names | {key: name})
