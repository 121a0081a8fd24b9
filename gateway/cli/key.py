"""`metaros key`: API keys for programs, made at a running gateway or in its data directory."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli.accounts import LocalDir, Robots, RoleOption, checked_role, client_or_none, life_s, local_store
from gateway.cli.options import StoreUrl
from metaros.cli.shared.gateway_http import GatewayOption, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output
from metaros.sanitize import sanitize

__all__ = ["register"]

Scopes = Annotated[
    list[str] | None,
    typer.Option("--scope", metavar="SCOPE", help="lambda: the key may also sign requests to functions."),
]
Expires = Annotated[str, typer.Option("--expires", metavar="SPAN", help="When it ends: 12h, 30d, 1y; default: never.")]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="API keys: how programs sign in.")
    for name, command in (("create", _create), ("list", _list), ("revoke", _revoke)):
        noun.command(name)(command)
    app.add_typer(noun, name="key")


def _create(
    name: Annotated[str, typer.Option("--name", "-n", metavar="NAME", help="What it is for.")],
    role: RoleOption,
    robots: Robots = None,
    scope: Scopes = None,
    expires: Expires = "",
    data_dir: LocalDir = None,
    store: StoreUrl = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Make a key, and print it: nobody can look it up again."""
    out = Output(output)
    wanted: dict[str, Any] = {
        "name": name,
        "role": checked_role(role),
        "robots": robots or ["*"],
        "scopes": scope or [],
        "expires_s": life_s(expires),
    }
    client = client_or_none(data_dir, store, gateway)
    made = client.post("/api/v1/keys", wanted) if client is not None else _create_here(data_dir, store, wanted)
    if out.json:
        out.objects(made)
        return
    out.line(sanitize(made["key"]))
    out.note(f"key {sanitize(made['id'])}, {sanitize(made['role'])}: it is not shown again")


def _create_here(data_dir: Path | None, store: str, wanted: dict[str, Any]) -> Any:
    """The same in a store on this machine: a key of nobody's."""
    from gateway.api.views.identity import new_key_view
    from gateway.domain.principal import Role
    from gateway.identity.keys import KeyRequest, create_key
    from gateway.identity.users import checked_robots

    request = KeyRequest(
        wanted["name"],
        Role.of(wanted["role"]),
        checked_robots(wanted["robots"]),
        frozenset(wanted["scopes"]),
        wanted["expires_s"],
    )
    with local_store(data_dir, store) as here:
        master = here.master if request.scopes else None
        made = here.change(
            "keys.manage",
            request.name,
            lambda engine: create_key(engine, request, owner=None, master=master, now_ns=here.now_ns),
        )
    return new_key_view(made, "")


def _list(
    data_dir: LocalDir = None, store: StoreUrl = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT
) -> None:
    """The keys there are, the newest first; one's own, or for an admin everybody's."""
    out = Output(output)
    client = client_or_none(data_dir, store, gateway)
    found = client.get("/api/v1/keys")["keys"] if client is not None else _list_here(data_dir, store)
    names = ("Id", "Name", "User", "Role", "Robots", "Scopes", "Expires", "Used")
    out.listing(names, found, _row, empty="no keys")


def _list_here(data_dir: Path | None, store: str) -> list[dict[str, Any]]:
    from gateway.api.views.identity import key_view
    from gateway.store.accounts.api_keys import list_keys
    from gateway.store.accounts.users import list_users
    from metaros.limits import LIMITS

    with local_store(data_dir, store) as here:
        names = {user.id: user.name for user in here.run(lambda engine: list_users(engine, limit=LIMITS.users))}
        found = here.run(lambda engine: list_keys(engine, limit=LIMITS.keys_listed))
    return [key_view(key, names.get(key.user_id or "", "")) for key in found]


def _row(item: dict[str, Any]) -> tuple[str, ...]:
    robots, scopes = " ".join(item["robots"]), " ".join(item["scopes"])
    expires, used = (item["expires"] or "never")[:10], (item["used"] or "never")[:10]
    return item["id"], item["name"], item["user"] or "–", item["role"], robots, scopes or "–", expires, used


def _revoke(
    key_id: Annotated[str, typer.Argument(metavar="ID", help="The key, as `metaros key list` shows it.")],
    data_dir: LocalDir = None,
    store: StoreUrl = "",
    gateway: GatewayOption = "",
) -> None:
    """End a key for ever; what is connected with it is cut within seconds."""
    client = client_or_none(data_dir, store, gateway)
    if client is not None:
        client.delete(f"/api/v1/keys/{path_part(key_id)}")
        return
    from gateway.identity.keys import revoke_key

    with local_store(data_dir, store) as here:
        here.change("keys.manage", key_id, lambda engine: revoke_key(engine, key_id))
