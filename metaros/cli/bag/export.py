"""`metaros bag export`: JSON lines, CSV tables, pictures."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from metaros.cli.shared.options import Format, FormatOption

__all__ = ["export"]


class Kind(StrEnum):
    """What comes out."""

    JSON = "json"
    CSV = "csv"
    IMAGES = "images"


def export(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="An .mcap file, or a folder of them.")],
    target: Annotated[
        Path | None,
        typer.Argument(
            metavar="[PATH]", show_default=False, help="A new folder; for JSON a file, else standard output."
        ),
    ] = None,
    kind: Annotated[Kind, typer.Option("--format", "-f", metavar="json|csv|images", help="What to write.")] = Kind.JSON,
    topics: Annotated[
        list[str] | None, typer.Option("--topics", metavar="GLOB", help="Only these; may be repeated.")
    ] = None,
    fields: Annotated[
        list[str] | None,
        typer.Option("--field", metavar="PATH", help="A CSV column, pose.pose.position.x; may be repeated."),
    ] = None,
    start: Annotated[
        float, typer.Option("--start", "-s", min=0.0, metavar="SECONDS", help="From so far into the recording.")
    ] = 0.0,
    duration: Annotated[
        float, typer.Option("--duration", "-d", min=0.0, metavar="SECONDS", help="So much; 0: to the end.")
    ] = 0.0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Turn a recording into JSON lines, one CSV table a topic, or picture files."""
    from metaros.cli.shared.output import Output, counted
    from metaros.errors import ConfigError, UsageError
    from metaros.record import export_csv, export_images, export_json, open_bag

    out, source = Output(output), open_bag(bag)
    begin_ns = source.first_ns + round(start * 1e9)
    end_ns = begin_ns + round(duration * 1e9) if duration else 1 << 63
    messages = source.messages(topics or (), start_ns=begin_ns if start else 0, end_ns=end_ns)
    if kind is Kind.JSON:
        if target is None:
            export_json(messages, sys.stdout)
            return
    elif target is None:
        raise UsageError(f"--format {kind} writes files: name a folder")
    try:
        if kind is Kind.JSON:
            with _new(target).open("x", encoding="utf-8") as file:
                made = {target: export_json(messages, file)}
        elif kind is Kind.CSV:
            made = export_csv(messages, _new(target), fields=fields or ())
        else:
            made = export_images(messages, _new(target))
    except OSError as error:
        raise ConfigError(f"cannot write {target}: {error.strerror or error}") from error
    if out.json:
        out.objects([{"path": str(path), "count": count} for path, count in made.items()])
        return
    word = {"json": "line", "csv": "row", "images": "image"}[kind]
    for path, count in made.items():
        out.line(f"{path}: {counted(count, word)}")
    if not made:
        out.note("nothing to export there")


def _new(path: Path) -> Path:
    from metaros.errors import ConfigError

    if path.exists():
        raise ConfigError(f"{path} is there already, and is not overwritten")
    return path
