"""Configuration of the manual's site: `make docs` builds it into build/site, without the network."""

import logging
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "_extensions")]

from ciberrato.version import __version__  # noqa: E402

project = "ciberrato"
author = "the ciberrato developers"
copyright = author
release = version = __version__

extensions = [
    "myst_nb",  # Markdown, and a page that is a notebook: executed when the site is built
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "mathml",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinxcontrib.programoutput",
]
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext"}
exclude_patterns = ["_templates", "_extensions", "_static"]
templates_path = ["_templates"]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4

# A notebook runs in the Python that builds the manual, whatever kernels are installed, and logs errors only.
os.environ["JUPYTER_PATH"] = str(ROOT / "docs" / "_extensions")
logging.getLogger("traitlets").setLevel(logging.WARNING)
nb_kernel_rgx_aliases = {"python3": "quiet"}
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300  # seconds a cell, on a busy machine

numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
default_role = "py:obj"
autodoc_typehints = "none"  # numpydoc's sections say the types, with shapes and units

copybutton_prompt_text = "$ "
programoutput_prompt_template = "$ {command}\n{output}"
os.environ.update(
    COLUMNS="90", PATH=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", PYTHONPATH=str(ROOT)
)

html_math_renderer = "mathml"
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["notebook.css"]
html_title = f"ciberrato {release}"
