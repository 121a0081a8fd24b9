"""`metaros driver probe` and `metaros driver new`: what is plugged in, and a driver for what no kind knows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.shared.options import Format, FormatOption

if TYPE_CHECKING:
    from metaros.drivers.probing import Found

__all__ = ["new", "probe"]


def probe(
    kinds: Annotated[list[str] | None, typer.Argument(metavar="[KIND]...", help="Only these; all without one.")] = None,
    output: FormatOption = Format.TEXT,
) -> None:
    """Look for devices; print what starts their drivers."""
    from metaros.cli.shared.output import Output, counted
    from metaros.drivers import all_manifests, manifest_of
    from metaros.drivers.registry import probe as look

    out = Output(output)
    manifests = [manifest_of(kind) for kind in kinds] if kinds else list(all_manifests())
    found: list[Found] = []
    for manifest, devices in look(manifests):
        if out.tty:
            out.note(f"{manifest.kind}: {counted(len(devices), 'device')}")
        found += devices
    found.sort(key=lambda device: not device.certain)
    out.listing(
        ("Start it by", "What it is", ""),
        [
            {
                "kind": device.kind,
                "summary": device.summary,
                "certain": device.certain,
                "parameters": dict(device.parameters),
                "command": device.command,
            }
            for device in found
        ],
        lambda row: (row["command"], row["summary"], "" if row["certain"] else "perhaps"),
        empty="nothing found: is it plugged in, and may you read it (group dialout or video)?",
    )


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the driver, such as depth.")],
    directory: Annotated[Path, typer.Option("--directory", metavar="DIR", help="Where its folder goes.")] = Path(),
) -> None:
    """Write the folder of a new driver, with tests."""
    from metaros.drivers.scaffold import scaffold

    for path in scaffold(name, directory):
        typer.echo(str(path))
    folder = directory / name
    where = folder if folder.is_absolute() else f"./{folder.as_posix()}"
    typer.echo(f"test it:  python -m pytest {folder}")
    typer.echo(f"run it:   metaros driver run {where} --param port=/dev/ttyUSB0")
