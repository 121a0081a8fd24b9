"""`metaros gateway store migrate`: the tables made and brought up to date before any gateway of the store starts."""

from __future__ import annotations

from typing import Annotated

import typer

from gateway.cli.accounts import LocalDir, local_store
from gateway.cli.options import StoreUrl
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output

__all__ = ["migrate"]

Admin = Annotated[
    bool, typer.Option("--admin", help="Where nobody could look after the gateway, make the user admin, too.")
]


def migrate(
    admin: Admin = False, data_dir: LocalDir = None, store: StoreUrl = "", output: FormatOption = Format.TEXT
) -> None:
    """Make the tables or bring them up to date, as a gateway does when it starts; where they are, nothing changes."""
    from gateway.identity.users import first_admin
    from gateway.store.accounts.users import has_admin
    from gateway.store.engine import shown
    from gateway.store.schema import MIGRATIONS

    out = Output(output)
    with local_store(data_dir, store) as here:
        made = ""
        if admin and not here.run(has_admin):
            user = here.change("users.manage", "first admin", lambda engine: first_admin(engine, now_ns=here.now_ns))
            made = user.name
        document = {"schema": len(MIGRATIONS), "admin": made}
        where = shown(store) if store else str(here.folder)
    if out.json:
        out.objects(document)
        return
    out.line(f"the store at {where} has schema {document['schema']}")
    if made:
        out.line(f"made {made}, an administrator without a password: `metaros signin --user {made}` prints a link")
