"""`metaros update`: versions that robots may be given. Keys and signatures are made offline, on a machine of one's own;
only `online-keys`, `publish`, `list` and `withdraw` speak to a gateway.

A passphrase comes from a prompt or a file, never from the command line, which every process of the machine can read.
"""

from __future__ import annotations

import getpass
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.shared.gateway_http import GatewayOption, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted, human_bytes
from metaros.errors import ConfigError, UsageError

if TYPE_CHECKING:
    from gateway.fleet.updates.offline import Passphrase

__all__ = ["register"]

ROOT_KEYS = ("root-1", "root-2", "root-3")
Folder = Annotated[Path, typer.Argument(metavar="FOLDER", file_okay=False, help="The folder with keys and bundles.")]
PassphraseFile = Annotated[
    Path | None,
    typer.Option(
        "--passphrase-file",
        exists=True,
        dir_okay=False,
        metavar="FILE",
        help="Its first line is the passphrase of every key that is used; default: a prompt for each.",
    ),
]
Online = Annotated[
    Path | None,
    typer.Option(
        "--online", exists=True, dir_okay=False, metavar="FILE", help="What `metaros update online-keys` printed."
    ),
]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="Signed updates of agents and nodes: make, sign and publish them.")
    commands = (
        ("online-keys", _online_keys),
        ("init-root", _init_root),
        ("add", _add),
        ("sign", _sign),
        ("publish", _publish),
        ("list", _list),
        ("withdraw", _withdraw),
    )
    for name, command in commands:
        noun.command(name)(command)
    app.add_typer(noun, name="update")


def _online_keys(
    fresh: Annotated[bool, typer.Option("--fresh", help="Make new ones, for the next root.")] = False,
    gateway: GatewayOption = "",
) -> None:
    """Print the public keys that the root has to name for this gateway's store; carry them to the offline machine."""
    made = open_gateway(gateway).post("/api/v1/updates/online-keys", {"fresh": fresh})
    Output().line(json.dumps(made["keys"], indent=2))


def _init_root(folder: Folder, online: Online = None, passphrase_file: PassphraseFile = None) -> None:
    """Offline: make three keys of the root, one for targets, and the first root."""
    from gateway.fleet.updates import offline

    if online is None:
        raise UsageError("--online FILE is needed: metaros update online-keys prints it")
    offline.init_root(folder, _document(online), _passphrase(passphrase_file, new=True), now_ns=_now_ns())
    out = Output()
    out.line(f"root 1 in {folder}: any 2 of root-1, root-2 and root-3 sign the next one")
    out.note(f"give each of {folder}/keys/root-*.pem to another person; robots trust {folder}/metadata/1.root.json")


def _add(
    folder: Folder,
    bundle: Annotated[Path, typer.Argument(metavar="BUNDLE", exists=True, dir_okay=False, help="A bundle's zip file.")],
    group: Annotated[str, typer.Option("--group", metavar="NAME", help="Only for robots of this group.")] = "",
    passphrase_file: PassphraseFile = None,
) -> None:
    """Offline: check a bundle and put it among those that the next signature names."""
    from gateway.fleet.updates import offline

    Output().line(offline.add(folder, bundle, group=group, passphrase=_passphrase(passphrase_file, new=True)))


def _sign(
    folder: Folder,
    role: Annotated[str, typer.Argument(metavar="ROLE", help="targets, robots/GROUP or root.")] = "targets",
    keys: Annotated[
        list[str] | None, typer.Option("--key", metavar="NAME", help="Of root: which keys sign; may be repeated.")
    ] = None,
    rotate: Annotated[bool, typer.Option("--rotate", help="Of root: make the next version first.")] = False,
    replace: Annotated[
        str, typer.Option("--replace", metavar="NAME", help="With --rotate: a new key for this one, as root-2.")
    ] = "",
    online: Online = None,
    passphrase_file: PassphraseFile = None,
) -> None:
    """Offline: sign targets, a group's targets, or the root; each signature is a next version."""
    from gateway.fleet.updates import offline

    out, passphrase = Output(), _passphrase(passphrase_file)
    if role != "root":
        if keys or rotate or replace or online:
            raise UsageError("--key, --rotate, --replace and --online are of root alone")
        made = offline.sign_role(folder, role, passphrase, now_ns=_now_ns()).signed
        out.line(f"{role} {made.version}: {counted(len(made.targets), 'target')}, until {made.expires:%Y-%m-%d}")
        return
    if (replace or online) and not rotate:
        raise UsageError("--replace and --online make a next root: add --rotate")
    if rotate:
        fresh = _document(online) if online is not None else None
        ask = _passphrase(passphrase_file, new=True)
        offline.rotate_root(folder, online=fresh, replace=replace, passphrase=ask, now_ns=_now_ns())
    enough = offline.sign_root(folder, keys or (), passphrase, now_ns=_now_ns())
    out.line("root: signed by enough keys" if enough else "root: more keys have to sign it: --key root-1 …")


def _publish(folder: Folder, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Upload what is signed, with its bundles; what the gateway has already is left out."""
    from gateway.fleet.updates import offline

    out, client, found = Output(output), open_gateway(gateway), offline.release(folder)
    there = {one["path"] for one in client.get("/api/v1/updates")["bundles"]}
    for path, bundle in found.bundles.items():
        if path not in there:
            group = path.split("/")[1] if path.startswith("robots/") else None
            client.send("/api/v1/updates/bundles", bundle, kind="application/zip", group=group)
            out.note(f"{path} uploaded")
    document = {
        "roots": [text.decode() for text in found.roots],
        "targets": found.targets.decode(),
        "groups": {role: text.decode() for role, text in found.groups.items()},
    }
    published = client.post("/api/v1/updates/metadata", document)
    if out.json:
        out.objects(published)
        return
    out.line(", ".join(f"{role} {version}" for role, version in sorted(published["roles"].items())))


def _list(gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """The versions that were uploaded, and until when what is signed counts."""
    out = Output(output)
    found = open_gateway(gateway).get("/api/v1/updates")
    if out.json:
        out.objects(found)
        return
    names = ("Path", "State", "Size", "Uploaded", "By")
    out.table(names, [_row(item) for item in found["bundles"]], empty="no bundle was uploaded", right=(2,))
    for role in found["roles"]:
        out.note(f"{role['role']} {role['version']} until {role['expires'][:16]}Z")
    if found["trouble"]:
        out.note(f"what ends soon cannot be signed again here: {found['trouble']}")


def _row(item: dict[str, Any]) -> tuple[str, ...]:
    state = "withdrawn" if item["withdrawn"] else "signed" if item["signed"] else "unsigned"
    return item["path"], state, human_bytes(item["size_bytes"]), item["uploaded"][:16], item["uploaded_by"]


def _withdraw(
    path: Annotated[str, typer.Argument(metavar="PATH", help="The target's path, as `metaros update list` shows it.")],
    reason: Annotated[str, typer.Option("--reason", metavar="TEXT", help="Why, for whoever looks later.")] = "",
    folder: Annotated[
        Path | None,
        typer.Option(
            "--folder", file_okay=False, metavar="FOLDER", help="Offline: leave it out of the next signature."
        ),
    ] = None,
    gateway: GatewayOption = "",
) -> None:
    """Hand a version out no more; robots that run it keep it until they are given another one."""
    from gateway.fleet.updates import offline

    if folder is not None:
        offline.remove(folder, path)
        Output().note(f"sign and publish {folder} to take it out of what is signed")
        return
    open_gateway(gateway).post("/api/v1/updates/withdrawals", {"path": path, "reason": reason})


def _passphrase(file: Path | None, *, new: bool = False) -> Passphrase:
    """Asks for a key's passphrase, of new keys twice; or the file's first line for every key."""
    if file is not None:
        lines = file.read_bytes().splitlines()
        said = lines[0] if lines else b""
        return lambda name: said
    return _prompt_twice if new else _prompt


def _prompt(name: str) -> bytes:
    return getpass.getpass(f"Passphrase of {name}: ").encode()


def _prompt_twice(name: str) -> bytes:
    first = getpass.getpass(f"New passphrase of {name}: ")
    if getpass.getpass("Again: ") != first:
        raise UsageError("the two passphrases differ")
    return first.encode()


def _document(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} cannot be read: {error}") from error
    if not isinstance(found, dict):
        raise ConfigError(f"{path} holds no keys")
    return found


def _now_ns() -> int:
    from metaros.clock import SystemClock

    return SystemClock().wall_ns()
