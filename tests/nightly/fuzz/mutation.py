"""Random damage of files: as disks, transfers and editors do it, and as nobody would."""

import re

import numpy as np

LIMITS = (0, 1, -1, 2**7, 2**8 - 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1)
TEXTS = (b"", b"-", b"0", b"1e308", b"nan", b"inf", b"9" * 20, b"1,5", b'"', b"\x00", b"\xff", b"\r", b"0x1F", b"\xb0")
NUMBER_OR_WORD = re.compile(rb"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?|[A-Za-z_][\w-]*")


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
    return content[:start] + bytes([content[start] ^ 1 << int(rng.integers(8))]) + content[start + 1 :]


def _set_integer(content, start, _, rng):
    """Overwrite a size or an address by a limit of its type."""
    width = int(rng.choice([1, 2, 4, 8]))
    start = start // width * width
    value = LIMITS[rng.integers(len(LIMITS))] & (2 ** (8 * width) - 1)
    order = "little" if rng.integers(2) else "big"
    return content[:start] + value.to_bytes(width, order) + content[start + width :]


def _truncate(content, start, _, rng):
    return content[:start]


def _insert(content, start, _, rng):
    return content[:start] + rng.bytes(int(rng.integers(1, 17))) + content[start:]


def _delete(content, start, _, rng):
    return content[:start] + content[start + int(rng.integers(1, 65)) :]


def _repeat(content, start, _, rng):
    piece = content[start : start + int(rng.integers(1, 257))]
    return content[:start] + piece * int(rng.integers(2, 20)) + content[start:]


def _zero(content, start, _, rng):
    """As after a fault of the disk."""
    length = int(rng.integers(1, 400))
    return content[:start] + bytes(length) + content[start + length :]


def _splice(content, start, others, rng):
    """Put a piece of another file over one of this."""
    other, length = others[rng.integers(len(others))], int(rng.integers(1, 129))
    origin = _place(other, rng)
    return content[:start] + other[origin : origin + length] + content[start + length :]


def _edit(content, _, others, rng):
    """Replace a number or a word of a text."""
    matches = list(NUMBER_OR_WORD.finditer(content[:20_000]))
    if not matches:
        return content
    match, other = (matches[rng.integers(len(matches))] for _ in range(2))
    text = TEXTS[rng.integers(len(TEXTS))] if rng.integers(3) else other.group()
    return content[: match.start()] + text + content[match.end() :]


CHANGES = (_flip, _set_integer, _set_integer, _truncate, _insert, _delete, _repeat, _zero, _splice, _edit, _edit)
