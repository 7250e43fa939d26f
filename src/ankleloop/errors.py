"""The errors that ankleloop raises about its input."""

__all__ = ["NUMERICAL_ERRORS", "DataError", "UnstableLoopError"]


class DataError(ValueError):
    """Data that cannot be used: the message says what is wrong, where, and what to do."""


class UnstableLoopError(ValueError):
    """A simulated loop that diverges: the message names the parameters that make it unstable."""


# Of data and numerical routines: LinAlgError, DataError and UnstableLoopError are ValueErrors, FloatingPointError is an
# ArithmeticError. Where many records are processed, such an error refuses its record alone; mistakes in the program
# (TypeError, KeyError, AttributeError) stop the job.
NUMERICAL_ERRORS = (ValueError, ArithmeticError)
