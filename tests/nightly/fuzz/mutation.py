"""Random damage of files: as disks and transfers do it."""

import numpy as np


def mutate(content: bytes, others: list[bytes], rng: np.random.Generator) -> bytes:
    """Change a file at random, once or several times; `others` are files from which a piece may come."""
    for _ in range(min(int(rng.geometric(0.5)), 8)):
        change = CHANGES[rng.integers(len(CHANGES))]
        if content:
            content = change(content, _place(content, rng), others, rng)
    return content


def _place(content, rng):
    """A byte, near the beginning or anywhere: headers are as likely as the samples that fill most of a file."""
    return int(rng.integers(len(content) if rng.integers(2) else min(len(content), 1024)))


def _flip(content, start, _, rng):
    """Flip one bit."""
    return (
        content[:start] + bytes([content[start] ^ 1 << int(rng.integers(8))]) + content[start + 1 :]
    )


def _truncate(content, start, _, rng):
    return content[:start]


def _insert(content, start, _, rng):
    return content[:start] + rng.bytes(int(rng.integers(1, 17))) + content[start:]


def _zero(content, start, _, rng):
    """As after a fault of the disk."""
    length = int(rng.integers(1, 400))
    return content[:start] + bytes(length) + content[start + length :]


def _splice(content, start, others, rng):
    """Put a piece of another file over one of this."""
    other, length = others[rng.integers(len(others))], int(rng.integers(1, 129))
    origin = _place(other, rng)
    return content[:start] + other[origin : origin + length] + content[start + length :]


CHANGES = (_flip, _truncate, _insert, _zero, _splice)
