"""Batches: all trials of one condition in one file, so that a job can loop over them."""

import json

import xarray as xr

from ankleloop.errors import DataError
from ankleloop.storage import write_netcdf
from ankleloop.trial import validate

__all__ = ["load_trials", "save_trials"]

OWN = "own_attributes"


def save_trials(trials, path):
    """Write trials of equal length and sampling rate to one NetCDF file, whole or not at all.

    Parameters
    ----------
    trials : sequence of xarray.Dataset
        The trials, each of shape (N,) per variable.
    path : path-like
        File to write.

    Raises
    ------
    DataError
        If there are no trials, or they differ in length, variables or sampling rate.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop.trial import new_trial
    >>> trials = [new_trial([0.0, 0.01, 0.02], [0.0, 1.0, 2.0], 100.0, seed=k) for k in range(2)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_trials(trials, f"{folder}/batch.nc")
    ...     [trial.attrs["seed"] for trial in load_trials(f"{folder}/batch.nc")]
    [0, 1]
    """
    trials = list(trials)
    if not trials:
        raise DataError(f"{path}: there are no trials to save.")
    first = trials[0]
    for k, trial in enumerate(trials):
        same = trial.sizes == first.sizes and set(trial.data_vars) == set(first.data_vars)
        if not same or trial.attrs["sampling_rate"] != first.attrs["sampling_rate"]:
            raise DataError(f"trial {k} differs from trial 0 in length, variables or sampling rate: save it by itself.")
    shared = {n: v for n, v in first.attrs.items() if all(t.attrs.get(n) == v for t in trials)}
    batch = xr.concat(trials, dim="trial", combine_attrs="override")
    own = [json.dumps({n: v for n, v in trial.attrs.items() if n not in shared}) for trial in trials]
    batch = batch.assign({OWN: ("trial", own)})
    batch.attrs = shared
    write_netcdf(batch, path, {name: {"_FillValue": None} for name in batch.variables if name != OWN})


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
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as batch:
        for k in range(batch.sizes["trial"]):
            trial = batch.isel(trial=k).load()
            own = json.loads(str(trial[OWN].values))
            trial = trial.drop_vars(OWN).assign_attrs(own)
            trial.attrs = {n: v.item() if hasattr(v, "item") else v for n, v in trial.attrs.items()}
            yield validate(trial, source=f"{path}, trial {k}")
