"""Random damage of files: as disks, transfers and editors do it, and as nobody would."""

import re

import numpy as np

LIMITS = (0, 1, -1, 2**7, 2**8 - 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1)
TEXTS = (
    b"", b"-", b"0", b"-0", b"1e308", b"1e-320", b"nan", b"inf", b"999999999999999999999", b"1,5", b"'", b'"', b"\x00",
    b"\xff", b"[]", b"{}", b"null", b"true", b"~", b"../..", b"/dev/zero", b"\r", b"0x1F", b"1_0", b"2026-01-31",
    b"&a *a", b"<<", b"$HOME", b"${NO}", "°".encode(),
)  # fmt: skip
NUMBER = re.compile(rb"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_][\w-]*")


def mutate(content: bytes, others: list[bytes], rng: np.random.Generator) -> bytes:
    """Change a file at random, once or several times.

    `others` are files from which a piece may come.
    """
    for _ in range(min(int(rng.geometric(0.5)), 8)):
        change = CHANGES[rng.integers(len(CHANGES))]
        content = change(content, others, rng)
    return content


def _flip(content, _, rng):
    """Flip one bit; headers are as likely as the samples that fill most of a file."""
    if not content:
        return content
    data = bytearray(content)
    data[_place(content, rng)] ^= 1 << int(rng.integers(8))
    return bytes(data)


def _set_byte(content, _, rng):
    if not content:
        return content
    data = bytearray(content)
    data[_place(content, rng)] = int(rng.choice([0, 1, 127, 128, 255, int(rng.integers(256))]))
    return bytes(data)


def _set_integer(content, _, rng):
    """Overwrite a size or an address by a limit of its type."""
    width = int(rng.choice([2, 4, 8]))
    if len(content) < width:
        return content
    start = _place(content, rng) // width * width
    value = LIMITS[rng.integers(len(LIMITS))] & (2 ** (8 * width) - 1)
    order = "little" if rng.integers(2) else "big"
    return content[:start] + value.to_bytes(width, order) + content[start + width :]


def _truncate(content, _, rng):
    return content[: int(rng.integers(len(content) + 1))]


def _insert(content, _, rng):
    start = _place(content, rng) if content else 0
    return content[:start] + rng.bytes(int(rng.integers(1, 17))) + content[start:]


def _delete(content, _, rng):
    if not content:
        return content
    start = _place(content, rng)
    return content[:start] + content[start + int(rng.integers(1, 65)) :]


def _repeat(content, _, rng):
    if not content:
        return content
    start = _place(content, rng)
    piece = content[start : start + int(rng.integers(1, 257))]
    return content[:start] + piece * int(rng.integers(2, 20)) + content[start:]


def _splice(content, others, rng):
    """Put a piece of another file over one of this."""
    other = others[rng.integers(len(others))]
    if not content or not other:
        return content
    start, origin, length = _place(content, rng), _place(other, rng), int(rng.integers(1, 129))
    return content[:start] + other[origin : origin + length] + content[start + length :]


def _edit_number(content, _, rng):
    """Replace a number of a text."""
    return _replace_match(NUMBER, content, rng)


def _edit_word(content, _, rng):
    """Replace a word of a text."""
    return _replace_match(WORD, content, rng)


def _replace_match(pattern, content, rng):
    matches = list(pattern.finditer(content[:20_000]))
    if not matches:
        return content
    match = matches[rng.integers(len(matches))]
    text = TEXTS[rng.integers(len(TEXTS))]
    if rng.integers(3) == 0:  # another word or number of the file
        text = matches[rng.integers(len(matches))].group()
    return content[: match.start()] + text + content[match.end() :]


def _place(content: bytes, rng: np.random.Generator) -> int:
    """A byte, near the beginning or anywhere."""
    end = len(content) if rng.integers(2) else min(len(content), 1024)
    return int(rng.integers(end))


CHANGES = (
    _flip, _flip, _set_byte, _set_integer, _set_integer, _truncate, _insert, _delete, _repeat, _splice, _edit_number,
    _edit_word,
)  # fmt: skip
