"""Write the rule graph that Snakemake draws into docs/architecture.md, between its markers."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
BLOCK = re.compile(r"(<!-- rulegraph -->\n).*?(<!-- /rulegraph -->)", re.DOTALL)


def draw_graph():
    """Rule graph of the default configuration in the mermaid language, without styles."""
    command = ["snakemake", "--rulegraph", "mermaid-js", "--forceall"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    lines = run.stdout[run.stdout.index("flowchart") :].splitlines()
    return "\n".join(line.rstrip() for line in lines if line.strip() and not line.strip().startswith("style "))


def insert_graph(page, graph):
    """The page with the graph between its markers."""
    return BLOCK.sub(lambda match: f"{match[1]}```mermaid\n{graph}\n```\n{match[2]}", page)


if __name__ == "__main__":
    PAGE.write_text(insert_graph(PAGE.read_text(encoding="utf-8"), draw_graph()), encoding="utf-8")
