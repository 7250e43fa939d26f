"""Compare all numbers and texts of two folders of results, for a change that should change none.

`python tests/regression/compare_results.py BEFORE AFTER` prints what differs; its exit status is 1 then. Numbers may
differ by 1e-6 of themselves or 1e-9 of the largest of their column, texts (verdicts among them) not at all. Times and
memory are left out.
"""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pandas as pd

RELATIVE, OF_LARGEST = 1e-6, 1e-9
MEASURED_ANEW = {"economy.csv"}  # times and memory, and the claims that rest on them
CLAIMS_MEASURED_ANEW = ["economy-time", "economy-memory"]


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """Columns of a table, or variables of a file of trials, by name."""
    if path.suffix == ".nc":
        with h5py.File(path) as file:
            return {name: read_variable(node) for name, node in file.items()}
    table = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)
    if path.name == "verification.csv":
        table = table[~table["id"].isin(CLAIMS_MEASURED_ANEW)]
    return {name: column.to_numpy() for name, column in table.items()}


def read_variable(node: h5py.Dataset) -> np.ndarray:
    """Samples of a variable; texts as texts."""
    return node.asstr()[:] if h5py.check_string_dtype(node.dtype) else node[...]


def split_values(values: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Numbers and texts of a column, also of what its cells hold as lists or as JSON, each in their order."""
    if values.dtype.kind in "biuf":
        return values.ravel().astype(float), []
    numbers: list[np.ndarray] = []
    texts: list[str] = []
    collect(values.tolist(), numbers, texts)
    return np.concatenate([np.empty(0), *numbers]), texts


def collect(value, numbers: list[np.ndarray], texts: list[str]) -> None:
    """Add the numbers and the texts of a value."""
    if isinstance(value, str) and value[:1] in ("[", "{"):
        try:
            collect(json.loads(value), numbers, texts)
        except json.JSONDecodeError:  # a text in brackets
            texts.append(value)
    elif isinstance(value, dict):
        for key in sorted(value):
            texts.append(key)
            collect(value[key], numbers, texts)
    elif isinstance(value, list):
        for part in value:
            collect(part, numbers, texts)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        numbers.append(value.ravel().astype(float))
    elif isinstance(value, (bool, int, float)):
        numbers.append(np.array([value], float))
    else:
        texts.append(repr(value))


def compare_columns(before: np.ndarray, after: np.ndarray) -> str:
    """What differs between two columns; empty where nothing does."""
    numbers, texts = split_values(before)
    new_numbers, new_texts = split_values(after)
    if numbers.size != new_numbers.size or len(texts) != len(new_texts):
        return f"{numbers.size} numbers, {len(texts)} texts → {new_numbers.size}, {len(new_texts)}"
    for text, new in zip(texts, new_texts, strict=True):
        if text != new:
            return f"{text[:200]!r} → {new[:200]!r}"
    largest = np.max(np.abs(numbers[np.isfinite(numbers)]), initial=0.0)
    is_close = np.isclose(
        new_numbers, numbers, rtol=RELATIVE, atol=OF_LARGEST * largest, equal_nan=True
    )
    if is_close.all():
        return ""
    first = np.flatnonzero(~is_close)[0]
    return f"{(~is_close).sum()} of {numbers.size} numbers, the first {numbers[first]!r} → {new_numbers[first]!r}"


def compare_folders(before: Path, after: Path) -> tuple[list[str], int]:
    """What differs between two folders, a line each, and how many numbers were compared."""
    differences = []
    count = 0
    files = {path.relative_to(folder) for folder in (before, after) for path in list_files(folder)}
    for name in sorted(files):
        if not (before / name).exists() or not (after / name).exists():
            differences.append(f"{name}: in one folder alone")
            continue
        old = read_columns(before / name)
        new = read_columns(after / name)
        for column in sorted(old.keys() | new.keys()):
            if column not in old or column not in new:
                differences.append(f"{name}: {column}: in one folder alone")
                continue
            count += split_values(old[column])[0].size
            difference = compare_columns(old[column], new[column])
            if difference:
                differences.append(f"{name}: {column}: {difference}")
    return differences, count


def list_files(folder: Path) -> list[Path]:
    """Tables and files of trials of a folder of results; it has them all when the run is complete."""
    files = [path for suffix in ("parquet", "csv", "nc") for path in folder.rglob(f"*.{suffix}")]
    return [path for path in files if path.name not in MEASURED_ANEW and "source" not in path.parts]


if __name__ == "__main__":
    differences, count = compare_folders(Path(sys.argv[1]), Path(sys.argv[2]))
    print(*differences, f"{count} numbers compared, {len(differences)} differences", sep="\n")
    sys.exit(1 if differences or not count else 0)
