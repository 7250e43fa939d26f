"""Write the rule graph that Snakemake draws into docs/architecture.md, between its markers."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
BLOCK = re.compile(r"(<!-- rulegraph -->\n).*?(<!-- /rulegraph -->)", re.DOTALL)


def draw_graph():
    """Rule graph of the default configuration in the mermaid language: a line for each rule that needs others."""
    command = ["snakemake", "--rulegraph", "mermaid-js", "--forceall"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    names = dict(re.findall(r"^\s*(id\d+)\[(\w+)\]", run.stdout, re.MULTILINE))
    inputs = {}
    for source, target in re.findall(r"(id\d+) --> (id\d+)", run.stdout):
        inputs.setdefault(names[target], []).append(names[source])
    edges = [f"    {' & '.join(sorted(sources))} --> {target}" for target, sources in sorted(inputs.items())]
    return "\n".join(["flowchart TB", *edges])


def insert_graph(page, graph):
    """The page with the graph between its markers."""
    return BLOCK.sub(lambda match: f"{match[1]}```mermaid\n{graph}\n```\n{match[2]}", page)


if __name__ == "__main__":
    PAGE.write_text(insert_graph(PAGE.read_text(encoding="utf-8"), draw_graph()), encoding="utf-8")
