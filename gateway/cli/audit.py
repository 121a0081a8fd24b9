"""`metaros audit`: who changed what, and the proof that nobody changed the log itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli.accounts import LocalDir, client_or_none
from gateway.cli.options import ObjectsUrl, StoreUrl
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted
from metaros.errors import ConfigError
from metaros.sanitize import sanitize

__all__ = ["register"]

Limit = Annotated[int, typer.Option("--limit", "-n", min=1, max=1000, metavar="COUNT", help="The newest.")]
Before = Annotated[int | None, typer.Option("--before", min=1, metavar="NUMBER", help="Only rows before this one.")]
Action = Annotated[str, typer.Option("--action", metavar="PERMISSION", help="Only this, such as users.manage.")]
Name = Annotated[str, typer.Option("--name", metavar="NAME", help="Only what this user or key did.")]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="Who changed what on a gateway, and the proof of that log.")
    noun.command("list")(_list)
    noun.command("verify")(_verify)
    app.add_typer(noun, name="audit")


def _list(
    limit: Limit = 50,
    before: Before = None,
    action: Action = "",
    name: Name = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The newest rows of a gateway's audit log, the oldest of them first."""
    out = Output(output)
    query: dict[str, Any] = {"limit": limit, "before": before, "action": action or None, "name": name or None}
    found = open_gateway(gateway).get("/api/v1/audit", **query)["rows"][::-1]
    names = ("Number", "Time", "Who", "From", "Action", "Target", "Answer", "Detail")
    out.listing(names, found, _row, empty="no rows", right=(0,))


def _verify(
    data_dir: LocalDir = None,
    store: StoreUrl = "",
    objects: ObjectsUrl = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Prove every row, and compare the heads in the object store. Exit code 1 when something does not hold."""
    out = Output(output)
    client = client_or_none(data_dir, store, gateway)
    found = client.get("/api/v1/audit/verify") if client is not None else _prove_here(data_dir, store, objects)
    if out.json:
        out.objects(found)
    else:
        _show(out, found)
    if not found["ok"]:
        raise typer.Exit(1)


def _prove_here(data_dir: Path | None, store: str, objects: str) -> dict[str, Any]:
    """The same in a store on this machine, whose gateway may run or not; nothing is made that is not there."""
    from gateway.identity.master import MasterKey, key_file
    from gateway.settings import default_data_dir
    from gateway.store.accounts.audit_proof import prove
    from gateway.store.engines import open_engine
    from gateway.store.objects import open_objects
    from gateway.store.sqlite import DATABASE

    folder = data_dir or default_data_dir()
    if not store and not (folder / DATABASE).exists():
        raise ConfigError(f"there is no store in {folder}\nSay where the gateway keeps it: --data-dir, or --store.")
    seal = MasterKey.load_or_make(folder) if key_file(folder).exists() else None
    kept = open_objects(objects, folder)
    engine, _ = open_engine(store, folder)
    try:
        return prove(engine, kept, seal=seal)
    finally:
        engine.close()
        kept.close()


def _row(item: dict[str, Any]) -> tuple[str, ...]:
    answer = f"{item['status']} {item['code']}".strip()
    who = item["name"] or item["kind"]
    target = f"{item['method']} {item['target']}".strip()
    return (str(item["number"]), item["at"], who, item["address"], item["action"], target, answer, item["detail"])


def _show(out: Output, found: dict[str, Any]) -> None:
    for fault in found["faults"]:
        out.line(sanitize(f"row {fault['number']}: {fault['fault']}: {fault['detail']}"))
    if found["heads_error"]:
        out.line(sanitize(f"the exported heads cannot be read: {found['heads_error']}"))
    heads = f"{counted(found['heads'], 'exported head')}, {found['heads_sealed']} sealed with this gateway's key"
    out.line(f"{'the log holds' if found['ok'] else 'THE LOG DOES NOT HOLD'}: {counted(found['rows'], 'row')}, {heads}")
    out.line(sanitize(f"head: row {found['rows']} {found['hash']}"))
