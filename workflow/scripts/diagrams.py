"""Figures 1 and 2: the block diagrams."""

from pathlib import Path

from ankleloop.plotting.diagrams import closed_loop_diagram, parallel_cascade_diagram
from ankleloop.plotting.style import save_figure

from job import running

with running(snakemake):
    folder = Path(snakemake.output[0]).parent
    for name, diagram in (("figure1", parallel_cascade_diagram()), ("figure2", closed_loop_diagram())):
        save_figure(diagram, folder / name, suffixes=(".png", ".pdf", ".svg"), overwrite=True)
