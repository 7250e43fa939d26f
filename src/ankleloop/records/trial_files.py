"""Batches: all trials of one condition in one file, so that a job can loop over them."""

import json
from functools import partial

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.once import once
from ankleloop.records.files import number_type, write_netcdf
from ankleloop.records.trial import validate

__all__ = ["load_blocks", "load_trials", "save_trials"]

OWN = "own_attributes"
BLOCK = 25  # trials read at a time: each access to the file costs more than the numbers


def save_trials(trials, path, precision="double"):
    """Write trials of equal length and sampling rate to one NetCDF file, whole or not at all.

    A variable that is constant in every trial (the noise of a noise-free simulation) takes one number per trial.

    Parameters
    ----------
    trials : iterable of xarray.Dataset
        The trials, each of shape (N,) per variable.
    path : path-like
        File to write.
    precision : {"double", "single"}
        Floating-point numbers on disk. Single takes half the space and rounds to 6e-8 of a value, where a 16-bit
        converter rounds to 1.5e-5 of its range; trials are double again once loaded.

    Raises
    ------
    DataError
        If there are no trials, or they differ in length, variables or sampling rate.
    ValueError
        For an unknown precision.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop.records.trial import new_trial
    >>> trials = [new_trial([0.0, 0.01, 0.02], [0.0, 1.0, 2.0], 100.0, seed=k) for k in range(2)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_trials(trials, f"{folder}/batch.nc")
    ...     [trial.attrs["seed"] for trial in load_trials(f"{folder}/batch.nc")]
    [0, 1]
    """
    kind = number_type(precision)
    first, gathered, attributes = None, {}, []
    for k, trial in enumerate(trials):
        first = trial if first is None else first
        _check_alike(k, trial, first)
        attributes.append(trial.attrs)
        for name, variable in trial.data_vars.items():
            values = variable.values
            values = values[:1] if np.ptp(values) == 0 else values
            gathered.setdefault(name, []).append(values.astype(kind if values.size > 1 else float))
    if first is None:
        raise DataError(f"{path}: there are no trials to save.")
    shared = {n: v for n, v in first.attrs.items() if all(given.get(n) == v for given in attributes)}
    own = [json.dumps({n: v for n, v in given.items() if n not in shared}) for given in attributes]
    variables = {name: _packed(arrays, first[name].attrs, first.sizes["time"]) for name, arrays in gathered.items()}
    batch = xr.Dataset({**variables, OWN: ("trial", own)}, coords={"time": first["time"].variable}, attrs=shared)
    write_netcdf(batch, path, {name: {"_FillValue": None} for name in batch.variables if name != OWN})


def _check_alike(k, trial, first):
    same = trial.sizes == first.sizes and set(trial.data_vars) == set(first.data_vars)
    if not same or trial.attrs["sampling_rate"] != first.attrs["sampling_rate"]:
        raise DataError(f"trial {k} differs from trial 0 in length, variables or sampling rate: save it by itself.")


def _packed(arrays, attributes, samples):
    """Samples of all trials; one number each where every trial is constant."""
    if all(values.size == 1 for values in arrays):
        return ("trial", np.concatenate(arrays), attributes)
    return (("trial", "time"), np.stack([np.broadcast_to(values, samples) for values in arrays]), attributes)


def load_trials(path):
    """Read what `save_trials` wrote, one trial after the other.

    Parameters
    ----------
    path : path-like
        The file.

    Yields
    ------
    xarray.Dataset
        A valid trial.

    Raises
    ------
    DataError
        If a trial in the file is not valid.

    Examples
    --------
    >>> next(load_trials("nowhere.nc"))
    Traceback (most recent call last):
      ...
    FileNotFoundError: ...
    """
    for trials, _ in load_blocks(path):
        yield from trials


def load_blocks(path):
    """Read what `load_trials` reads, several trials at a time: one pass over a signal then serves all of them.

    Yields
    ------
    trials : list of xarray.Dataset
        Valid trials.
    signals : dict of str to ndarray, shape (trials, N)
        Variables by name, in double precision; a row belongs to a trial. Those that are constant are not among them.

    Raises
    ------
    DataError
        If a trial in the file is not valid.
    """
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as batch:
        time = batch["time"].load().variable
        for start in range(0, batch.sizes["trial"], BLOCK):
            block = batch.isel(trial=slice(start, start + BLOCK)).load()
            own = [json.loads(str(text)) for text in block[OWN].values]
            shared = {name: value.item() if hasattr(value, "item") else value for name, value in block.attrs.items()}
            kept = {name: variable for name, variable in block.variables.items() if name not in (OWN, "time")}
            signals = {name: kept[name].values.astype(float) for name in kept if kept[name].ndim > 1}
            trials = []
            for k, attributes in enumerate(own):
                variables = {
                    name: ("time", signals[name][k] if name in signals else _constant(v, k, time.size), v.attrs)
                    for name, v in kept.items()
                }
                trial = xr.Dataset(variables, coords={"time": time}, attrs=shared | attributes)
                source = f"{path}, trial {start + k}"
                trials.append(once(trial, "valid", partial(validate, trial, source=source)))
            yield trials, signals


def _constant(variable, trial, samples):
    """Samples of what is one number for each trial."""
    return np.full(samples, float(variable.values[trial]))
