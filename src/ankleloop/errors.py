"""The errors that ankleloop raises about its input."""

__all__ = ["DataError", "UnstableLoopError"]


class DataError(ValueError):
    """Data that cannot be used: the message says what is wrong, where, and what to do."""


class UnstableLoopError(ValueError):
    """A simulated loop that diverges: the message names the parameters that make it unstable."""
