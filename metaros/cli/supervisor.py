"""`metaros supervisor`: keep a robot's nodes running, beside its agent; `status` and `stop` ask the one that runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.shared.options import Format, FormatOption, StatusFile

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output

__all__ = ["register"]

StateDir = Annotated[
    Path | None, typer.Option("--state-dir", metavar="DIR", help="The robot's state directory; its agent's.")
]
Name = Annotated[str, typer.Option("--name", help="The robot, where its directory is ~/.metaros/agent/NAME.")]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    supervisor = typer.Typer(help="Keep this robot's nodes running, agent or no agent.", no_args_is_help=False)
    supervisor.callback(invoke_without_command=True)(supervise)
    supervisor.command("status")(status)
    supervisor.command("stop")(stop)
    app.add_typer(supervisor, name="supervisor")


def supervise(
    context: typer.Context,
    state_dir: StateDir = None,
    name: Name = "",
    detached: Annotated[
        bool, typer.Option("--detached", help="Write what happens to supervisor.log there, and nothing here.")
    ] = False,
    status_file: StatusFile = "",
) -> None:
    """Run the nodes of the directory's table until SIGTERM or Ctrl-C, then stop them in order."""
    if context.invoked_subcommand is not None:
        return
    import asyncio
    import logging

    from metaros.cli.shared.running import status_file as as_path
    from metaros.cli.shared.running import write_status
    from metaros.supervise import program

    folder = folder_of(state_dir, name)
    with program.only_one(folder):
        if detached:
            program.log_to_file(folder / "supervisor.log")
        else:
            logging.basicConfig(level=logging.INFO, format="%(asctime)s %(name)s %(levelname)s %(message)s")
        asyncio.run(
            program.run(folder, ready=lambda service: write_status(as_path(status_file), directory=str(folder)))
        )


def status(state_dir: StateDir = None, name: Name = "", output: FormatOption = Format.TEXT) -> None:
    """Show the nodes and how they do. Exit code 1 where no supervisor runs."""
    from metaros.cli.shared.output import Output
    from metaros.errors import UnavailableError
    from metaros.supervise.client import ask

    out, folder = Output(output), folder_of(state_dir, name)
    try:
        found = ask(folder, "list")
    except UnavailableError as error:
        if out.json:
            out.objects([])
        else:
            out.note(str(error))
        raise typer.Exit(1) from None
    if out.json:
        out.objects([found])
    else:
        show(out, folder, found)


def stop(state_dir: StateDir = None, name: Name = "") -> None:
    """Ask the supervisor to end: its nodes stop in order. Its agent starts none until you do."""
    from metaros.concurrency.waiting import pause
    from metaros.errors import TimeoutError_
    from metaros.supervise import program
    from metaros.supervise.client import ask

    folder = folder_of(state_dir, name)
    ask(folder, "shutdown")
    for _ in range(int(3 * program.STOP_GRACE_S / 0.1)):
        if program.running_pid(folder) is None:
            typer.echo("stopped")
            return
        pause(0.1)
    raise TimeoutError_(f"the supervisor of {folder} still runs; metaros supervisor stop once more kills its nodes")


def folder_of(state_dir: Path | None, name: str) -> Path:
    """The state directory that was meant."""
    from metaros.errors import ConfigError

    if state_dir is not None:
        return state_dir.absolute()
    if not name or "/" in name or "\\" in name or name in (".", ".."):
        raise ConfigError("which robot? --state-dir DIR, or --name NAME for ~/.metaros/agent/NAME")
    return Path.home() / ".metaros" / "agent" / name


def show(out: Output, folder: Path, found: dict[str, Any]) -> None:
    """As a table."""
    out.note(f"{folder}  (pid {found['pid']}, table {found['table']})")
    rows = [
        (
            node["name"],
            f"{node['state']}, {node['why']}" if node["why"] else node["state"],
            node["pid"] or "",
            node["restarts"],
            node["version"],
            node["last_exit"],
        )
        for node in found["nodes"]
    ]
    out.table(("node", "state", "pid", "restarts", "version", "last exit"), rows, right=(2, 3))
