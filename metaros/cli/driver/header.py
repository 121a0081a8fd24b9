"""`metaros driver header`: C99 for a microcontroller that joins by a serial line or by zenoh-pico."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["header"]


def header(
    types: Annotated[
        list[str], typer.Argument(metavar="TYPE...", help="Such as std_msgs/msg/Bool; what they contain comes along.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Write it there, instead of printing it.")
    ] = None,
) -> None:
    """Write the C99 header of these messages: structs, CDR, frames of a serial line, keys for zenoh-pico."""
    from metaros.drivers.serial.c_header import render_header
    from metaros.errors import ConfigError

    text = render_header(types)
    if out is None:
        typer.echo(text, nl=False)
        return
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{out}: {error.strerror}") from None
    typer.echo(f"{out}: {len(text.splitlines())} lines for {', '.join(types)}")
