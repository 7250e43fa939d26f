"""Check what ankleloop is built on: consistency, licences, bill of materials, known vulnerabilities.

Writes results/audit. Each check says what it covered; a check that could not run says so, and is no success.
"""

import argparse
import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

from licences import dependencies, is_permitted, licence_of

ROOT = Path(__file__).parents[1]
PASSED, FAILED, NOT_RUN = "passed", "FAILED", "could not run"


def run(*command):
    """Run a program; its output goes into the answer."""
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, cwd=ROOT)


def check_consistency():
    """Whether every distribution has what it requires, in a version that it accepts."""
    process = run(sys.executable, "-m", "pip", "--disable-pip-version-check", "check")
    return (FAILED if process.returncode else PASSED), process.stdout.strip()


def check_licences(tools, folder):
    """Whether the licences of all distributions that running ankleloop needs are permitted."""
    listing = folder / "licences.csv"
    process = run(tools / "pip-licenses", f"--python={sys.executable}", "--format=csv", f"--output-file={listing}")
    if process.returncode:
        return NOT_RUN, process.stderr.strip()
    names = dependencies("ankleloop", ["workflow"])
    refused = [f"{name}: {licence_of(name) or 'none'}" for name in names if not is_permitted(licence_of(name))]
    if refused:
        return FAILED, f"not permitted: {'; '.join(refused)}"
    return (
        PASSED,
        f"{len(names)} distributions; all of the environment, with the tests', are in {listing.relative_to(ROOT)}",
    )


def write_materials(tools, folder):
    """Write the bill of materials of the environment."""
    bill = folder / "sbom.cdx.json"
    command = (tools / "cyclonedx-py", "environment", sys.executable, "--pyproject", ROOT / "pyproject.toml")
    process = run(*command, "--output-reproducible", "--output-format", "JSON", "--output-file", bill)
    if process.returncode:
        return NOT_RUN, process.stderr.strip()
    components = json.loads(bill.read_text(encoding="utf-8"))["components"]
    return PASSED, f"{len(components)} components in {bill.relative_to(ROOT)}"


def check_advisories(tools, folder):
    """Whether a published vulnerability concerns a version of the lock; needs the database of advisories."""
    answer = folder / "advisories.json"
    answer.unlink(missing_ok=True)
    lock = ("--requirement", ROOT / "environment.lock", "--disable-pip", "--require-hashes")
    options = ("--format", "json", "--output", answer, "--progress-spinner", "off", "--timeout", "20")
    process = run(tools / "pip-audit", *lock, *options)
    if not answer.exists():
        return NOT_RUN, f"no answer from the database of advisories: {process.stderr.strip().splitlines()[-1:]}"
    return judge_advisories(json.loads(answer.read_text(encoding="utf-8"))["dependencies"])


def judge_advisories(entries):
    """Result of the audit of each distribution; where the database did not answer, nothing is known of it."""
    skipped = [entry["name"] for entry in entries if "skip_reason" in entry]
    concerned = [entry for entry in entries if entry.get("vulns")]
    text = f"{len(entries) - len(skipped)} of {len(entries)} distributions were compared with the advisories"
    if concerned:
        names = [
            f"{entry['name']} {entry['version']}: {', '.join(v['id'] for v in entry['vulns'])}" for entry in concerned
        ]
        return FAILED, f"{text}; {'; '.join(names)}"
    if skipped:
        reasons = Counter(entry["skip_reason"].split(":")[0] for entry in entries if "skip_reason" in entry)
        return NOT_RUN, f"{text}: {reasons.most_common(1)[0][0]}. Run it where the database can be reached"
    return PASSED, text


def exit_status(results):
    """0 where every check has run and passed, 1 where one has failed, 2 where one could not run."""
    return 1 if FAILED in results else 2 if NOT_RUN in results else 0


def main():
    """Run all checks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tools", type=Path, required=True, help="folder of the programs")
    tools = parser.parse_args().tools.absolute()
    folder = ROOT / "results" / "audit"
    folder.mkdir(parents=True, exist_ok=True)
    results = {
        "consistency": check_consistency(),
        "licences": check_licences(tools, folder),
        "bill of materials": write_materials(tools, folder),
        "advisories": check_advisories(tools, folder),
    }
    summary = {name: {"result": result, "text": text} for name, (result, text) in results.items()}
    (folder / "audit.json").write_text(json.dumps(summary, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    for name, (result, text) in results.items():
        print(f"{name}: {result}. {text}")
    return exit_status([result for result, _ in results.values()])


if __name__ == "__main__":
    sys.exit(main())
