"""Hankel matrices themselves, which the library never stores."""

from ankleloop.subspace.hankel import block_hankel


def stack_rows(x, rows):
    """The Hankel matrix, each row less its mean."""
    H = block_hankel(x, 0, rows, len(x) - rows + 1)
    return H - H.mean(axis=1, keepdims=True)
