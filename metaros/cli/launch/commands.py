"""`metaros launch`: keep a table of nodes running; look at, restart and stop them from another terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, ZenohPort

if TYPE_CHECKING:
    from metaros.cli.launch.plan import Place
    from metaros.supervise import LaunchTable

__all__ = ["register"]

REQUESTS = ("status", "restart", "stop")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("launch")(launch)


def launch(
    what: Annotated[str, typer.Argument(metavar="FILE|status|restart|stop", help="A launch table, or a request.")],
    node: Annotated[str, typer.Argument(metavar="NODE", help="For restart and stop: which.")] = "",
    check: Annotated[bool, typer.Option("--check", help="Read the table, say what is wrong, start nothing.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show what would be started, in which order, and end.")
    ] = False,
    plain: Annotated[bool, typer.Option("--plain", help="No live table on a terminal, only lines.")] = False,
    log_dir: Annotated[
        Path | None,
        typer.Option("--log-dir", metavar="DIR", show_default="the user's data folder", help="A file a node."),
    ] = None,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Start a table of nodes and keep them running until Ctrl-C.

    `status`, `restart NODE` and `stop NODE` ask the launchers that run; a table of such a name is ./status.
    """
    from metaros.errors import ConfigError

    if what in REQUESTS:
        from metaros.cli.launch.request import request

        request(what, node, zenoh_port=zenoh_port, domain=domain, output=output)
        return
    if node:
        raise ConfigError(f"metaros launch {what} takes no node; did you mean: metaros launch restart {node}")
    _launch(Path(what), check=check, dry_run=dry_run, plain=plain, log_dir=log_dir, port=zenoh_port, domain=domain)


def _launch(
    path: Path, *, check: bool, dry_run: bool, plain: bool, log_dir: Path | None, port: int, domain: int
) -> None:
    from metaros.cli.launch.plan import Place, check_exists
    from metaros.cli.shared.instances import data_root
    from metaros.supervise import read_table

    table = read_table(path)
    check_exists(table)
    folder = log_dir.absolute() if log_dir is not None else data_root() / "launch" / path.stem
    place = Place(zenoh_port=port, domain=domain, log_dir=folder)
    if check:
        count = len(table.nodes)
        typer.echo(f"{path}: good, {count} node{'' if count == 1 else 's'}")
    elif dry_run:
        from metaros.cli.launch.dry_run import show

        show(table, place)
    else:
        _run(table, place, plain=plain)


def _run(table: LaunchTable, place: Place, *, plain: bool) -> None:
    import asyncio

    from metaros.cli.launch.run import run
    from metaros.cli.launch.screen import Screen
    from metaros.cli.router import open_or_join
    from metaros.clock import SystemClock, system_rng

    clock = SystemClock()
    screen = Screen(table, clock=clock, plain=plain)
    router = open_or_join(place.zenoh_port, "127.0.0.1", "metaros launch FILE --zenoh-port PORT")
    try:
        screen.title(place, hosted=router is not None)
        failed = asyncio.run(run(table, place, screen, clock=clock, rng=system_rng()))
    finally:
        if router is not None:
            router.close()
    if failed:
        raise typer.Exit(1)
