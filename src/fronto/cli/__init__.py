"""The command line: parses, calls the library, prints one line a photo.

Each command is a module of its own, loaded when it is asked for; what it needs in turn
(NumPy, ONNX Runtime, PyTorch) is loaded when it runs.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import click

from fronto._version import __version__
from fronto.cli.shared import BAD_INPUT, say
from fronto.errors import InputError

__all__ = ["main"]

#: In the order of the help; the module of the same name holds `command`.
COMMANDS = (
    "rectify",
    "find",
    "segment",
    "outline",
    "camera",
    "train",
    "export",
    "quantize",
    "relations",
    "verifier",
    "masks",
    "edges",
    "evaluate",
    "render",
    "curves",
)


class _Group(click.Group):
    """Commands whose wrong input is one line on stderr and exit code 2."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f"fronto.cli.{cmd_name}").command
        return command

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except InputError as error:
            say(f"Error: {error}", err=True)
            ctx.exit(BAD_INPUT)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="fronto", message="%(prog)s %(version)s")
def main() -> None:
    """A head-on view of any elevator button panel, from one photo."""
