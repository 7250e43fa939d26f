"""What several methods need of one trial, made once."""

from contextlib import contextmanager

__all__ = ["made_once", "once"]

_kept = None


@contextmanager
def made_once():
    """Keep what is made of a trial for the next method that needs the same; nobody may change the trial meanwhile.

    Outside of this context nothing is kept: a trial may be changed between two identifications.

    Examples
    --------
    >>> made = []
    >>> with made_once():
    ...     for _ in range(3):
    ...         value = once("trial", "velocity", lambda: made.append(1) or 5.0)
    >>> value, len(made)
    (5.0, 1)
    """
    global _kept
    outer, _kept = _kept, {}
    try:
        yield
    finally:
        _kept = outer


def once(trial, key, make):
    """What `make` returns, or has returned already for this trial and key.

    Parameters
    ----------
    trial : object
        What it is made of.
    key : hashable
        What it is.
    make : callable
        Makes it; the result must not be changed.

    Returns
    -------
    object
    """
    if _kept is None:
        return make()
    if (id(trial), key) not in _kept:
        _kept[id(trial), key] = trial, make()  # the trial as well: its id is its own while it lives
    return _kept[id(trial), key][1]
