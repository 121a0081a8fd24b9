"""`metaros bag`: record topics into MCAP files, look at recordings, play them, cut them, turn them into other files."""

from __future__ import annotations

import typer

from metaros.cli import bag_export, bag_files, bag_play, bag_record

__all__ = ["register"]

group = typer.Typer(name="bag", no_args_is_help=True, help="Recordings: record, look, play, cut, export.")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


group.command("record")(bag_record.record)
group.command("save")(bag_record.save)
group.command("info")(bag_files.info)
group.command("play")(bag_play.play)
group.command("cut")(bag_files.cut)
group.command("export")(bag_export.export)
group.command("recover")(bag_files.recover)
