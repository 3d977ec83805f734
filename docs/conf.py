"""Settings of the documentation site: `make docs` builds it into build/docs."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import plotly

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import bowden
from reference import write_reference

write_reference(HERE / "reference")
shutil.copyfile(
    Path(plotly.__file__).parent / "package_data" / "plotly.min.js",
    HERE / "_static" / "plotly.min.js",
)
os.environ["IPYTHONDIR"] = str(HERE / "_ipython")
os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"

project = "bowden"
author = "the bowden developers"
project_copyright = "the bowden developers, Apache-2.0"
version = release = bowden.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
]
source_suffix = {".md": "myst-nb"}
exclude_patterns = ["_ipython", "_static", "_templates"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE.parent / "build" / "docs-cache")
nb_execution_raise_on_error = True
nb_execution_timeout = 900
nb_merge_streams = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
copybutton_prompt_text = r"\$ |>>> "
copybutton_prompt_is_regexp = True
# Indented blocks are shell commands, YAML or formulas: no language is right for all of them.
highlight_language = "none"
suppress_warnings = ["myst.xref_missing", "mystnb.unknown_mime_type", "config.cache"]

html_theme = "furo"
html_title = f"bowden {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
templates_path = ["_templates"]
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#00598f", "color-brand-content": "#00598f"},
    "dark_css_variables": {"color-brand-primary": "#7cc4f0", "color-brand-content": "#7cc4f0"},
}
