"""Advice about an extra that is not installed."""

import json
import shlex
import sys
from importlib.metadata import PackageNotFoundError, distribution
from typing import Final
from urllib.parse import unquote, urlsplit

_PROJECT: Final = "khepera-macor"


def how_to_install(extra: str) -> str:
    """Return the command that adds an extra to the installation that is running.

    It names this interpreter, and the folder or archive that the project was installed from.
    """
    wanted = f"{_PROJECT}[{extra}]"
    options: tuple[str, ...] = ()
    try:
        origin = json.loads(distribution(_PROJECT).read_text("direct_url.json") or "{}")
    except (PackageNotFoundError, ValueError):
        origin = {}
    url = urlsplit(str(origin.get("url", "")))
    if url.scheme == "file":
        wanted = f"{unquote(url.path)}[{extra}]"
        options = ("-e",) if origin.get("dir_info", {}).get("editable") else ()
    return shlex.join([sys.executable, "-m", "pip", "install", *options, wanted])
