"""Sphinx configuration of the book.  ``build.py`` gathers the sources that this reads."""

import sys
from hashlib import sha256
from importlib.metadata import distribution
from pathlib import Path

BOOK = Path(__file__).resolve().parent
sys.path.insert(0, str(BOOK / "_ext"))
import edition  # noqa: E402

project = "Where Am I?"
author = "The Where Am I? authors"
copyright = "the Where Am I? authors. Text and figures: CC BY 4.0. Code: BSD-3-Clause"
language = "en"

extensions = [
    "myst_nb",
    "sphinx_design",
    "sphinx_proof",
    "sphinx_exercise",
    "sphinx_copybutton",
    "sphinx_togglebutton",
    "sphinxcontrib.bibtex",
    "sphinx.ext.viewcode",
    "answer_scripts",
    "cards",
    "docstrings",
    "downloads",
    "explorers",
    "lab_map",
    "launch",
    "page_numbers",
    "sections",
    "talking",
    "symbols_in_text",
    "terms",
]
exclude_patterns = []

# --- text -------------------------------------------------------------------------------------------------
myst_enable_extensions = ["amsmath", "attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
math_eqref_format = "({number})"
numfig = True
math_numfig = False  # equations, too, are counted on each page
bibtex_reference_style = "author_year"
copybutton_exclude = ".linenos, .gp, .go"

# --- the package: what the docstrings say ------------------------------------------------------------------
sys.path.insert(0, str(BOOK.parent))
autodoc_typehints = "none"  # the signature has them in a checker's words; the text has shapes and units
autodoc_preserve_defaults = True
add_module_names = False
viewcode_line_numbers = True

# --- labs: build.py has run them --------------------------------------------------------------------------
nb_execution_mode = "off"
nb_output_stderr = "warn"  # and a warning is an error: a page shows no stray message
nb_merge_streams = True
nb_ipywidgets_js = {}  # explorers are plain HTML; no widget manager
nb_code_prompt_show = "Show the code"
nb_code_prompt_hide = "Hide the code"

# --- equations: one file, from this site, with every TeX package in it -------------------------------------
MATHJAX = distribution("sphinx-mathjax-offline").locate_file("sphinx-mathjax-offline/static/mathjax/tex-svg-full.js")
mathjax_path = "tex-svg-full.js"
mathjax3_config = {
    "options": {"enableMenu": False},  # the menu would fetch parts that are not here
    "tex": {"packages": {"[-]": ["noerrors", "noundefined"]}},  # a mistake is to be seen, by the tests first of all
    "svg": {"fontCache": "global"},
}

# --- pages ------------------------------------------------------------------------------------------------
html_theme = "sphinx_book_theme"
html_title = "Where Am I?"
html_logo = "_static/logo.svg"
html_favicon = "_static/logo.svg"
html_static_path = ["_static", str(MATHJAX), str(BOOK.parent / "coursekit" / "teaching" / "explore" / "explorer.css")]
html_css_files = ["explorer.css", "icons.css", "book.css", "reference.css"]  # finish.py writes the icons
html_domain_indices = False
html_show_sphinx = False
# The last step belongs to a page: when it changes, every page is written again.
LAST_STEP = [BOOK / name for name in ("finish.py", "pictures.py", "typeset.js")]
html_context = {"default_mode": "auto", "finish": sha256(b"".join(path.read_bytes() for path in LAST_STEP)).hexdigest()}
templates_path = ["_templates"]
html_theme_options = {
    "navbar_start": [],
    "navbar_center": [],
    "navbar_end": [],
    "navbar_persistent": [],
    "footer_content_items": ["copyright.html", "edition.html"],
    "show_toc_level": 2,
    "home_page_in_toc": True,
    "use_download_button": True,
    "use_fullscreen_button": False,
    "search_bar_text": "Search the book …",
    "logo": {"text": "Where Am I?", "alt_text": "Where Am I? The front page"},
}
# A published copy knows its repository; a copy on somebody's disk need not.
if repository := (course_repository := edition.repository()):
    html_baseurl = edition.site()
    html_theme_options |= {
        "repository_url": repository,
        "use_repository_button": True,
        "use_issues_button": True,
    }


def setup(app):
    """The bibliography lies beside the pages that build.py gathered, not beside this file."""

    def find_bibliography(app, config):
        config.bibtex_bibfiles = [str(Path(app.srcdir) / "references.bib")]

    app.connect("config-inited", find_bibliography)
