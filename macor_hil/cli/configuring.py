"""The command `macor-hil config`."""

import typer
from khepera_protocol.config_file import add_config

app = typer.Typer()
add_config(app, "run")
