"""Configuration of Sphinx: `make docs` builds the site from the pages in this folder and from the docstrings."""

import sys
from pathlib import Path

from jupyter_client.manager import KernelManager

import ankleloop

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "ankleloop"
author = "The ankleloop developers"
project_copyright = author
version = release = ankleloop.__version__
root_doc = "index"
language = "en"
smartquotes = False  # of messages and code, which readers search for
toc_object_entries = False

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_design",
    "library_tables",
    "mathml",
    "outside_pages",
]
exclude_patterns = ["extensions", "templates", "**/README.md"]
templates_path = ["templates"]

# Pages whose text stands elsewhere in the project.
outside_pages = {
    "how-to/configuration": "config/README.md",
    "how-to/contributing": "CONTRIBUTING.md",
    "reference/changes": "CHANGELOG.md",
    "reference/published-data": "data/README.md",
    "explanation/security": "SECURITY.md",
}

nitpicky = True
default_role = "library-name"

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 4
nb_execution_mode = "auto"
nb_execution_raise_on_error = True
nb_execution_in_temp = True
nb_execution_timeout = 120
nb_merge_streams = True
# Without encryption the kernel of each page warns, and MyST-NB has no setting for it.
KernelManager.transport_encryption.default_value = "auto"

autosummary_generate = True
autodoc_typehints = "none"  # types stand in the docstrings
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

html_theme = "pydata_sphinx_theme"
html_title = f"ankleloop {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": "ankleloop"},
    "navigation_with_keys": False,
    "show_nav_level": 1,
    "show_toc_level": 2,
    "navbar_align": "left",
    "footer_start": ["copyright"],
    "footer_end": ["theme-version"],
    "secondary_sidebar_items": ["page-toc"],
}
copybutton_exclude = ".linenos, .gp, .go"
