"""Licences of the distributions that ankleloop needs, from their metadata, and which of them are permitted."""

import re
from importlib.metadata import PackageNotFoundError, distribution

from packaging.requirements import Requirement

# Permissive licences, and those whose duties end at their own files (MPL-2.0): an MIT-licensed program may use all of
# them. Names as the metadata of distributions have them: SPDX identifiers, classifiers and older texts.
PERMITTED = {
    *("MIT", "MIT License", "MIT-0", "MIT-CMU", "0BSD", "Zlib", "CC0-1.0", "Unlicense", "The Unlicense (Unlicense)"),
    *("BSD License", "BSD", "BSD-2-Clause", "BSD-3-Clause", "BSD 3-Clause", "3-Clause BSD License", "New BSD"),
    *("Apache-2.0", "Apache 2.0", "Apache Software License", "Apache License, Version 2.0", "Apache License 2.0"),
    *("Apache-2.0 WITH LLVM-exception", "ISC", "ISC License (ISCL)", "Public Domain", "HPND"),
    *("PSF-2.0", "Python Software Foundation License", "Python-2.0"),
    *("MPL-2.0", "Mozilla Public License 2.0 (MPL 2.0)"),
}
# How the text of a licence begins that has no name in the metadata.
TEXTS = {
    "MIT License": "MIT",
    "The MIT License": "MIT",
    "BSD 3-Clause License": "BSD-3-Clause",
    "Apache License": "Apache-2.0",
}
CLASSIFIER = "License :: "


def licence_of(name):
    """Licence of an installed distribution: its SPDX expression, its classifiers, its text; empty if there is none."""
    metadata = distribution(name).metadata
    if metadata.get("License-Expression"):
        return metadata["License-Expression"]
    classifiers = [text for text in metadata.get_all("Classifier", []) if text.startswith(CLASSIFIER)]
    names = [text.split(" :: ")[-1] for text in classifiers if text.split(" :: ")[-1] != "OSI Approved"]
    text = (metadata.get("License") or "").strip()
    if names:
        return " OR ".join(names)
    return text if text and "\n" not in text else _licence_of_file(name)


def _licence_of_file(name):
    """Licence by the first line of its file."""
    for file in distribution(name).files or ():
        if re.match(r"(?i)licen[cs]e", file.name):
            first = file.read_text(encoding="utf-8").lstrip().splitlines()[0].strip()
            return next((licence for text, licence in TEXTS.items() if first.startswith(text)), "")
    return ""


def is_permitted(licence):
    """Whether every part of a licence that holds is permitted; of alternatives one is enough."""
    if licence in PERMITTED:
        return True
    parts = [re.split(r"\s+OR\s+|;\s*", part) for part in re.split(r"\s+AND\s+", licence)]
    return all(
        any(option.strip(" ()") in PERMITTED or option.strip() in PERMITTED for option in part) for part in parts
    )


def dependencies(name, extras=()):
    """Names of all installed distributions that a distribution needs, directly or through others."""
    reached, pending = set(), [(name, frozenset(extras))]
    seen = set()
    while pending:
        current, wanted = pending.pop()
        if (current, wanted) in seen:
            continue
        seen.add((current, wanted))
        try:
            requirements = distribution(current).requires or ()
        except PackageNotFoundError:  # for another platform, or an optional one that is not there
            continue
        reached.add(current)
        for text in requirements:
            requirement = Requirement(text)
            contexts = [{"extra": extra} for extra in (*wanted, "")]
            if requirement.marker is None or any(map(requirement.marker.evaluate, contexts)):
                pending.append((_normalise(requirement.name), frozenset(requirement.extras)))
    return sorted(reached - {name})


def _normalise(name):
    return re.sub(r"[-_.]+", "-", name).lower()
