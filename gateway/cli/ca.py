"""`metaros ca`: the fleet's issuer and its root: list, rotate, renew, retire.

It works in the data directory of the gateway that has the root's key, whether its gateway runs or not; every gateway on
that store follows within seconds. There is no way to it over the network.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli.accounts import LocalDir, local_store
from gateway.cli.options import StoreUrl
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted

if TYPE_CHECKING:
    from gateway.identity.certificates.rotation import Issuer

__all__ = ["register"]

SECOND_NS = 1_000_000_000
PIN_CHARS = 12
ACTION = "ca.rotate"
Root = Annotated[bool, typer.Option("--root", help="A new root, too; robots learn it with their next certificate.")]
Force = Annotated[bool, typer.Option("--force", help="Also when robots are left that then need a new token.")]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="The fleet's certificate authority, and how it is replaced.")
    for name, command in (("list", _list), ("rotate", _rotate), ("renew", _renew), ("retire", _retire)):
        noun.command(name)(command)
    app.add_typer(noun, name="ca")


def _list(data_dir: LocalDir = None, store: StoreUrl = "", output: FormatOption = Format.TEXT) -> None:
    """The issuers that the fleet recognises, the newest first, and how many robots hold a certificate of each."""
    from gateway.identity.certificates.rotation import issuers

    out = Output(output)
    with local_store(data_dir, store) as here:
        found = here.run(lambda engine: issuers(engine, now_ns=here.now_ns))
    if out.json:
        out.objects([_document(one) for one in found])
        return
    names = ("Issuer", "Root", "State", "Made", "Ends", "Robots")
    out.table(names, [_row(one) for one in found], empty="the first enrolment token makes an authority", right=(5,))


def _rotate(
    root: Root = False, data_dir: LocalDir = None, store: StoreUrl = "", output: FormatOption = Format.TEXT
) -> None:
    """Make the next issuer; those before are recognised until `metaros ca retire`."""
    from gateway.identity.certificates.rotation import rotate_issuer, rotate_root, settle

    out = Output(output)
    with local_store(data_dir, store) as here:
        make = rotate_root if root else rotate_issuer
        made = here.change(
            ACTION, "new root" if root else "new issuer", lambda engine: make(engine, here.folder, now_ns=here.now_ns)
        )
        here.run(lambda engine: settle(engine, here.folder))
    if out.json:
        out.objects({"root" if root else "issuer": made})
        return
    out.line(f"new root {made[:PIN_CHARS]}" if root else f"new issuer {made[:PIN_CHARS]}")
    out.note("robots get its certificates when they renew; ask them to now with: metaros ca renew")


def _renew(data_dir: LocalDir = None, store: StoreUrl = "", output: FormatOption = Format.TEXT) -> None:
    """Ask every robot to renew its certificate now, or when it comes back: its link is cut for a moment."""
    from gateway.store.accounts.issuers import set_renew_before

    out = Output(output)
    with local_store(data_dir, store) as here:
        before_ns = here.now_ns // SECOND_NS * SECOND_NS  # certificates know whole seconds
        here.change(ACTION, "renew all", lambda engine: set_renew_before(engine, before_ns))
    if out.json:
        out.objects({"renew_before_ns": before_ns})
        return
    out.line("robots renew when they next speak to a gateway; see who has: metaros ca list")


def _retire(
    force: Force = False, data_dir: LocalDir = None, store: StoreUrl = "", output: FormatOption = Format.TEXT
) -> None:
    """Recognise the newest issuer alone, and trust its root alone. Refused while a robot would be left behind."""
    from gateway.identity.certificates.rotation import retire, settle

    out = Output(output)
    with local_store(data_dir, store) as here:
        done = here.change(ACTION, "retire", lambda engine: retire(engine, now_ns=here.now_ns, force=force))
        here.run(lambda engine: settle(engine, here.folder))
    if out.json:
        out.objects({"retired": list(done.drop), "kept": list(done.keep), "stranded": list(done.stranded)})
        return
    out.line(f"{counted(len(done.drop), 'issuer')} retired, {counted(len(done.stranded), 'robot')} stranded")
    for robot in done.stranded:
        out.note(f"{robot} needs a new token: metaros robot token --robot {robot}")


def _document(one: Issuer) -> dict[str, Any]:
    from gateway.api.views.robots import rfc3339

    return {
        "id": one.id,
        "state": one.state,
        "root": one.root_pin,
        "made": rfc3339(one.made_ns),
        "ends": rfc3339(one.not_after_ns),
        "robots": one.robots,
    }


def _row(one: Issuer) -> tuple[str, ...]:
    document = _document(one)
    made, ends = document["made"][:16], document["ends"][:10]
    return one.id[:PIN_CHARS], one.root_pin[:PIN_CHARS], one.state, made, ends, str(one.robots)
