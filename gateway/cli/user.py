"""`metaros user` and `metaros signin`: people, their roles and robots, and links that sign them in once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli.accounts import (
    LocalDir,
    Robots,
    RoleOption,
    checked_role,
    client_or_none,
    local_store,
    read_password,
)
from gateway.cli.options import StoreUrl
from metaros.access.address import DEFAULT_URL
from metaros.access.credentials import local_gateway
from metaros.cli.shared.gateway_http import GatewayOption, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted
from metaros.errors import UsageError
from metaros.sanitize import sanitize

__all__ = ["register", "register_signin"]

Name = Annotated[str, typer.Argument(metavar="NAME", help="The user's name.")]
FromStdin = Annotated[
    bool, typer.Option("--password-stdin", help="Read the password from the first line of standard input.")
]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="Users: who may sign in, and what they may do.")
    commands = (
        ("add", _add),
        ("list", _list),
        ("change", _change),
        ("password", _password),
        ("signout", _signout),
        ("remove", _remove),
    )
    for name, command in commands:
        noun.command(name)(command)
    app.add_typer(noun, name="user")


def register_signin(app: typer.Typer) -> None:
    """Add `metaros signin`."""
    app.command("signin")(_signin)


def _add(
    name: Name,
    role: RoleOption,
    robots: Robots = None,
    password_stdin: FromStdin = False,
    data_dir: LocalDir = None,
    store: StoreUrl = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Add a user; without a password they sign in by a link: `metaros signin --user NAME`."""
    password = read_password(from_stdin=True) if password_stdin else ""
    wanted = {"name": name, "role": checked_role(role), "robots": robots or ["*"], "password": password}
    client = client_or_none(data_dir, store, gateway)
    made = client.post("/api/v1/users", wanted) if client is not None else _add_here(data_dir, store, wanted)
    out = Output(output)
    if out.json:
        out.objects(made)
    else:
        out.line(sanitize(f"{made['name']}: {made['role']}, robots {' '.join(made['robots'])}"))


def _add_here(data_dir: Path | None, store: str, wanted: dict[str, Any]) -> Any:
    from gateway.api.views.identity import user_view
    from gateway.domain.principal import Role
    from gateway.identity.users import create_user

    hashed = _hashed(wanted["name"], wanted["password"]) if wanted["password"] else ""
    with local_store(data_dir, store) as here:
        made = here.change(
            "users.manage",
            wanted["name"],
            lambda engine: create_user(
                engine,
                wanted["name"],
                role=Role.of(wanted["role"]),
                robots=wanted["robots"],
                password_hash=hashed,
                now_ns=here.now_ns,
            ),
        )
    return user_view(made)


def _list(
    data_dir: LocalDir = None, store: StoreUrl = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT
) -> None:
    """Everybody who may sign in."""
    out = Output(output)
    client = client_or_none(data_dir, store, gateway)
    found = client.get("/api/v1/users")["users"] if client is not None else _list_here(data_dir, store)
    names = ("Name", "Role", "Robots", "Signs in by", "Last", "State")
    out.listing(names, found, _row, empty="no users")


def _list_here(data_dir: Path | None, store: str) -> list[dict[str, Any]]:
    from gateway.api.views.identity import user_view
    from gateway.store.accounts.users import list_users
    from metaros.limits import LIMITS

    with local_store(data_dir, store) as here:
        return [user_view(user) for user in here.run(lambda engine: list_users(engine, limit=LIMITS.users))]


def _row(item: dict[str, Any]) -> tuple[str, ...]:
    way = "password" if item["has_password"] else "provider" if item["external"] else "link"
    last = (item["signed_in"] or "never")[:10]
    return (
        item["name"],
        item["role"],
        " ".join(item["robots"]),
        way,
        last,
        "disabled" if item["disabled"] else "enabled",
    )


def _change(
    name: Name,
    role: Annotated[str, typer.Option("--role", "-r", metavar="ROLE", help="viewer, operator or admin.")] = "",
    robots: Robots = None,
    disable: Annotated[bool | None, typer.Option("--disable/--enable", help="Lock the user out, or in again.")] = None,
    data_dir: LocalDir = None,
    store: StoreUrl = "",
    gateway: GatewayOption = "",
) -> None:
    """Give a user another role or other robots, or lock them out."""
    changes: dict[str, Any] = {
        "role": checked_role(role) if role else None,
        "robots": robots or None,
        "disabled": disable,
    }
    changes = {key: value for key, value in changes.items() if value is not None}
    if not changes:
        raise UsageError("say what to change: --role, --robots, --disable or --enable")
    _send_change(name, changes, data_dir, store, gateway)


def _password(
    name: Name,
    password_stdin: FromStdin = False,
    data_dir: LocalDir = None,
    store: StoreUrl = "",
    gateway: GatewayOption = "",
) -> None:
    """Set a user's password; their sessions end."""
    _send_change(name, {"password": read_password(from_stdin=password_stdin)}, data_dir, store, gateway)


def _send_change(name: str, changes: dict[str, Any], data_dir: Path | None, store: str, gateway: str) -> None:
    client = client_or_none(data_dir, store, gateway)
    if client is not None:
        client.patch(f"/api/v1/users/{path_part(name)}", changes)
        return
    from gateway.domain.principal import Role
    from gateway.identity.users import change_user

    hashed = _hashed(name, changes["password"]) if "password" in changes else None
    role = Role.of(changes["role"]) if "role" in changes else None
    with local_store(data_dir, store) as here:
        here.change(
            "users.manage",
            name,
            lambda engine: change_user(
                engine,
                name,
                role=role,
                robots=changes.get("robots"),
                disabled=changes.get("disabled"),
                password_hash=hashed,
            ),
        )


def _signout(
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="The user's name.")] = "",
    everybody: Annotated[bool, typer.Option("--everybody", help="All users.")] = False,
    data_dir: LocalDir = None,
    store: StoreUrl = "",
) -> None:
    """End a user's sessions and sign-in links, or everybody's; what is connected by them is cut within seconds."""
    from gateway.identity.users import user_named
    from gateway.store.accounts.sessions import end_sessions
    from gateway.store.accounts.users import list_users
    from gateway.store.engine import StoreEngine
    from metaros.limits import LIMITS

    if bool(name) == everybody:
        raise UsageError("say either a user's name or --everybody")

    def job(engine: StoreEngine) -> int:
        users = list_users(engine, limit=LIMITS.users) if everybody else [user_named(engine, name)]
        return sum(end_sessions(engine, user.id) for user in users)

    with local_store(data_dir, store) as here:
        ended = here.change("users.manage", f"sign out {name or 'everybody'}", job)
    Output().line(f"{counted(ended, 'session')} ended")


def _remove(name: Name, data_dir: LocalDir = None, store: StoreUrl = "", gateway: GatewayOption = "") -> None:
    """Remove a user with their sessions and keys."""
    client = client_or_none(data_dir, store, gateway)
    if client is not None:
        client.delete(f"/api/v1/users/{path_part(name)}")
        return
    from gateway.identity.users import delete_user

    with local_store(data_dir, store) as here:
        here.change("users.manage", name, lambda engine: delete_user(engine, name))


def _signin(
    user: Annotated[str, typer.Option("--user", "-u", metavar="NAME", help="For whom; default: an admin.")] = "",
    url: Annotated[str, typer.Option("--url", metavar="URL", help="With --data-dir: the gateway's address.")] = "",
    data_dir: LocalDir = None,
    store: StoreUrl = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Print a link that signs a user in once, within 15 minutes. The first admin is made where there is none."""
    out = Output(output)
    client = client_or_none(data_dir, store, gateway)
    if client is not None:
        made = client.post("/api/v1/auth/links", {"name": user})
    else:
        made = _link_here(data_dir, store, user, (url or local_gateway(data_dir) or DEFAULT_URL).rstrip("/"))
    if out.json:
        out.objects(made)
        return
    out.line(sanitize(made["url"]))
    out.note(f"signs {sanitize(made['user'])} in once, within 15 minutes")


def _link_here(data_dir: Path | None, store: str, name: str, url: str) -> dict[str, str]:
    from gateway.api.views.robots import rfc3339
    from gateway.identity.signin import make_link
    from gateway.identity.users import first_admin, user_named
    from gateway.store.engine import StoreEngine

    with local_store(data_dir, store) as here:

        def job(engine: StoreEngine) -> dict[str, str]:
            user = user_named(engine, name) if name else first_admin(engine, now_ns=here.now_ns)
            link = make_link(engine, user, now_ns=here.now_ns)
            where = {"url": f"{url}/signin#{link.token}", "token": link.token}
            return {"user": user.name, **where, "expires": rfc3339(link.expires_ns)}

        return here.change("users.manage", f"link {name}".strip(), job)


def _hashed(name: str, password: str) -> str:
    from gateway.identity.passwords import check_password, hash_password

    check_password(password, name=name)
    return hash_password(password)
