"""Write codecheck.yml: the results that a run of the reduced configuration has to give, with their hashes.

The hash is that of the file of expected results; a result itself may differ from it within the tolerance of its row.
"""

import hashlib
import sys
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
EXPECTED = ROOT / "tests" / "regression" / "expected"
FILE = ROOT / "codecheck.yml"
HEADING = """\
---
# Written by `make expected`: results that a CODECHECK (https://codecheck.org.uk) of this repository compares. Nobody
# has done one yet: the fields of the check are empty.
"""


def describe():
    """Content of the file."""
    metadata = yaml.safe_load((ROOT / "metadata.yaml").read_text(encoding="utf-8"))
    titles = yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8"))[
        "studies"
    ]
    titles |= yaml.safe_load((ROOT / "config" / "beyond.yaml").read_text(encoding="utf-8")).get(
        "studies", {}
    )
    entries = []
    for path in sorted(EXPECTED.glob("*.csv")):
        title = titles.get(path.stem, {}).get("title", path.stem)
        comment = (
            f"{title}: means over the trials of the reduced configuration, each with its tolerance"
        )
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        entries.append(
            {"file": path.relative_to(ROOT).as_posix(), "comment": comment, "sha256": digest}
        )
    content = {
        "version": "https://codecheck.org.uk/spec/config/1.0",
        "paper": {
            "title": metadata["title"],
            "authors": [{"name": author["name"]} for author in metadata["authors"]],
            "reference": None,
        },
        "manifest": entries,
        "source": "make test runs the workflow, reduced by config/ci.yaml, and compares its results with these files",
        **dict.fromkeys(
            ("summary", "repository", "codechecker", "check_time", "certificate", "report")
        ),
    }
    return HEADING + yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=118)


if __name__ == "__main__":
    FILE.write_text(describe(), encoding="utf-8")
    sys.stdout.write(f"{FILE.name} lists {len(list(EXPECTED.glob('*.csv')))} files.\n")
