"""`metaros bag`: record topics into MCAP files, look at recordings, play them, cut them, turn them into other files."""

from __future__ import annotations

import typer

from metaros.cli.bag import export, files, play, record

__all__ = ["register"]

group = typer.Typer(name="bag", no_args_is_help=True, help="Recordings: record, look, play, cut, export.")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


group.command("record")(record.record)
group.command("save")(record.save)
group.command("info")(files.info)
group.command("play")(play.play)
group.command("cut")(files.cut)
group.command("export")(export.export)
group.command("recover")(files.recover)
