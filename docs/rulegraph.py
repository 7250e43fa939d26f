"""Write the rule graph that Snakemake draws into docs/architecture.md, between its markers."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
BLOCK = re.compile(r"(<!-- rulegraph -->\n).*?(<!-- /rulegraph -->)", re.DOTALL)
COMMAND = ("snakemake", "--rulegraph", "mermaid-js", "--forceall")


def format_graph(output):
    """The output of Snakemake in the mermaid language, shortened to a line for each rule that needs others."""
    names = dict(re.findall(r"^\s*(id\d+)\[(\w+)\]", output, re.MULTILINE))
    inputs = {}
    for source, target in re.findall(r"(id\d+) --> (id\d+)", output):
        inputs.setdefault(names[target], []).append(names[source])
    edges = [f"    {' & '.join(sorted(sources))} --> {target}" for target, sources in sorted(inputs.items())]
    return "\n".join(["flowchart TB", *edges])


def insert_graph(page, graph):
    """The page with the graph between its markers."""
    return BLOCK.sub(lambda match: f"{match[1]}```mermaid\n{graph}\n```\n{match[2]}", page)


if __name__ == "__main__":
    run = subprocess.run(COMMAND, cwd=ROOT, capture_output=True, text=True, check=True)
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(insert_graph(page, format_graph(run.stdout)), encoding="utf-8")
