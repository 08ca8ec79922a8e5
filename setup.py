"""Builds the package's long description: the README with links that a package index can follow.

Everything else about the package stands in pyproject.toml. A package index shows the README without
the files beside it. Where `[project.urls]` has a `Source`, links and pictures become absolute ones
at the tag of this version. Until there is one, pictures become their descriptions, and links the
names of files, which the source distribution holds.
"""

import re
import tomllib
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent

_LINK = re.compile(r"(?P<picture>!?)\[(?P<text>[^\]]*)\]\((?!https?:|#)(?P<path>[^)\s]+)\)")
_CODE = re.compile(r"(^```.*?^```|`[^`\n]+`)", re.DOTALL | re.MULTILINE)


def for_an_index(readme: str, source: str | None, tag: str) -> str:
    """Return the README as a package index can show it.

    Args:
        readme: in Markdown, with links relative to its folder.
        source: address of the repository; None: there is none yet.
        tag: of the version in the repository.
    """

    def link(found: re.Match[str]) -> str:
        picture, text, path = found["picture"], found["text"], found["path"]
        if source:
            kind = "raw" if picture else "blob"
            return f"{picture}[{text}]({source.rstrip('/')}/{kind}/{tag}/{path})"
        if picture:
            return f"*[Picture `{path}`: {text}]*"
        return f"{text} [`{path}`]"

    # code is shown as it is
    parts = _CODE.split(readme)
    return "".join(part if n % 2 else _LINK.sub(link, part) for n, part in enumerate(parts))


def main() -> None:
    """Hand the description to setuptools."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    readme = (ROOT / "README.md").read_text("utf-8")
    source = project.get("urls", {}).get("Source")
    setup(
        long_description=for_an_index(readme, source, f"v{project['version']}"),
        long_description_content_type="text/markdown",
    )


if __name__ == "__main__":
    main()
