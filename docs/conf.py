"""Settings of the documentation site, which `make docs` builds without a network; warnings are errors."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import wakewise

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))
# Examples draw into files, whether or not there is a screen.
os.environ.setdefault("MPLBACKEND", "Agg")

project = "Wakewise"
author = "The Wakewise developers"
copyright = "2026, the Wakewise developers"
release = wakewise.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "site_pages",
    "site_api",
    "site_math",
]
root_doc = "index"
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "_extensions", "gallery/**.py", "gallery/**.ipynb", "gallery/**.md5", "**/*.codeobj.json"]
nitpicky = True
highlight_language = "bash"

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "attrs_inline"]
myst_heading_anchors = 4
myst_dmath_double_inline = True

default_role = "code"
# Names in the sidebar of every page would double the time of a build; pages of the API list theirs at the top.
toc_object_entries = False
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: name for name in ("Array", "IntArray", "BoolArray", "ArrayLike", "PoseLike")}
autodoc_member_order = "alphabetical"
autodoc_preserve_defaults = True
autodoc_class_signature = "mixed"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

sphinx_gallery_conf = {
    "examples_dirs": "../examples/gallery",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/plot_",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    # Its page of times would fetch scripts from elsewhere.
    "write_computation_times": False,
    "min_reported_time": 1000,
    "plot_gallery": "True",
    "matplotlib_animations": False,
    "image_scrapers": ("matplotlib",),
    "reference_url": {"wakewise": None},
    "nested_sections": False,
    "within_subsection_order": "FileNameSortKey",
    # What a last line returns, such as axes, is not what a reader asks for; what is printed is shown.
    "capture_repr": (),
}

# MathML of _extensions/site_math.py: no script from elsewhere draws the formulas.
html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"Wakewise {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "sidebar_hide_name": False,
    "navigation_with_keys": True,
    "light_css_variables": {"color-brand-primary": "#0b6f86", "color-brand-content": "#0b6f86"},
    "dark_css_variables": {"color-brand-primary": "#5ad1c8", "color-brand-content": "#5ad1c8"},
}
pygments_style = "friendly"
pygments_dark_style = "github-dark"
