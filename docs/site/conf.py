"""Settings of the documentation site: `make docs`.

The pages are those of `docs/`, as they are; the navigation is the list in `docs/README.md`.
"""

import re
import shutil
import tomllib
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

DOCS = Path(__file__).parent.parent
METADATA = tomllib.loads((DOCS.parent / "pyproject.toml").read_text("utf-8"))["project"]

project = METADATA["name"]
author = METADATA["authors"][0]["name"]
copyright = author  # noqa: A001 (Sphinx asks for this name)
release = version = METADATA["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "README"
exclude_patterns = ["site"]
myst_heading_anchors = 3

autodoc_mock_imports = ["gymnasium", "pybullet"]
autodoc_default_options = {"members": True, "member-order": "bysource", "show-inheritance": True}
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
default_role = "code"
python_use_unqualified_type_names = True
add_module_names = False

html_theme = "furo"
# the help of commands, 100 columns, fits beside the navigation
html_theme_options = {
    name: {"code-font-size": "0.7rem"} for name in ("light_css_variables", "dark_css_variables")
}
html_title = f"{project} {release}"
html_copy_source = False
html_show_sphinx = False
# a page that is opened as a file may not read others to show parts of them
html_show_search_summary = False

_BOUNDS = re.compile(r"Annotated\[([^,]+?), FieldInfo\(.*?\]\)\]")


def navigation(_app: Sphinx, docname: str, source: list[str]) -> None:
    """Turn the sections of the index into those of the sidebar."""
    if docname == root_doc:
        for section in re.split(r"^## ", source[0], flags=re.MULTILINE)[1:]:
            pages = re.findall(r"\]\(([\w/-]+)\.md\)", section)
            caption = section.splitlines()[0]
            source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n"
            source[0] += "\n".join(pages) + "\n```\n"


def plain(*told: Any) -> None:
    """Keep bars and stars of a docstring's formulas from being read as markup."""
    lines: list[str] = told[-1]
    lines[:] = [re.sub(r"\||\*(?=\w)", r"\\\g<0>", line) for line in lines]


def without_bounds(*told: Any) -> tuple[str | None, str | None]:
    """Show the type of an option alone: its bounds are long, and the command reference has them."""
    signature, returned = told[-2:]
    return signature and _BOUNDS.sub(r"\1", signature), returned


def front_page(app: Sphinx, exception: Exception | None) -> None:
    """Give the site's folder a page that browsers and servers open."""
    if exception is None and app.builder.format == "html":
        shutil.copy(Path(app.outdir, "README.html"), Path(app.outdir, "index.html"))


def setup(app: Sphinx) -> None:
    """Connect to what Sphinx does."""
    app.connect("source-read", navigation)
    app.connect("autodoc-process-docstring", plain)
    app.connect("autodoc-process-signature", without_bounds)
    app.connect("build-finished", front_page)
