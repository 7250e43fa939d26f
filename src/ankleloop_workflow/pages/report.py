"""The page of an executed notebook: what it shows, and behind a study its faults and what made it."""

from __future__ import annotations

from markupsafe import Markup
from nbconvert import HTMLExporter
from nbformat import NotebookNode

from ankleloop_lab.pages.page import render_page
from ankleloop_lab.pages.rendering import render_table, render_template
from ankleloop_workflow.pages import TEMPLATES
from ankleloop_workflow.pages.study_page import StudyPage
from ankleloop_workflow.tables.captions import describe_values
from ankleloop_workflow.tables.outcomes import count_faults, list_reasons


def render_study(notebook: NotebookNode) -> str:
    """Page of the executed notebook of a study."""
    page = StudyPage(**notebook.metadata["parameter"])
    note, faults = "", ""
    if is_simulated(page):  # pages of recordings have their own
        note, faults = render_faults(page)
    body = f"{render_outputs(notebook)}{faults}{render_sources(page)}"
    return render_page(page.title, body, note=note, index="../index.html")


def render_article(notebook: NotebookNode) -> str:
    """Page of the executed article, which shows several studies."""
    title = notebook.metadata["parameter"]["title"]
    return render_page(title, render_outputs(notebook), index="index.html")


def render_outputs(notebook: NotebookNode) -> str:
    """Texts and outputs of a notebook as HTML, without its code."""
    exporter = HTMLExporter(template_name="basic", exclude_input=True, exclude_anchor_links=True)
    exporter.exclude_input_prompt = exporter.exclude_output_prompt = True
    return exporter.from_notebook_node(notebook)[0]


def is_simulated(page: StudyPage) -> bool:
    """Whether the trials of a study are in one table."""
    return "table_file" in vars(page)


def render_faults(page: StudyPage) -> tuple[str, str]:
    """Sentence that counts failures and warnings, and HTML with the reason of each; both empty without any."""
    reasons = list_reasons(page.details)
    if reasons.empty:
        return "", ""
    points = page.details.drop_duplicates("point").set_index("point")[page.keys].astype(object)
    settings = [describe_values(points.loc[name].dropna()) or name for name in reasons.pop("point")]
    cells = reasons.assign(method=reasons["method"].map(page.labels), example=settings)
    table = render_table(cells)
    return count_faults(page.details), f"<h2>Failures and warnings</h2>{table}"


def render_sources(page: StudyPage) -> Markup:
    """HTML that says of what trials the page is, and links what made it and the data behind it."""
    settings = page.describe() if page.points and is_simulated(page) else ""
    return render_template("sources.html.j2", TEMPLATES, settings=settings, **vars(page))
