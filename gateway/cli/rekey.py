"""`metaros gateway rekey`: another master key for a data directory, whose gateway may run or not."""

from __future__ import annotations

import typer

from gateway.cli.accounts import LocalDir, local_store
from gateway.cli.options import StoreUrl
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted
from metaros.errors import ConfigError

__all__ = ["register"]


def register(gateway: typer.Typer) -> None:
    """Add the command to `metaros gateway`."""
    gateway.command("rekey")(_rekey)


def _rekey(data_dir: LocalDir = None, store: StoreUrl = "", output: FormatOption = Format.TEXT) -> None:
    """Make a new master.key, seal by it what the old one sealed, and delete that. Run it again if it was stopped."""
    from gateway.identity import rekey
    from gateway.identity.master import MASTER_KEY, key_file
    from gateway.settings import default_data_dir

    out, file = Output(output), key_file(data_dir or default_data_dir())
    if not file.exists():
        raise ConfigError(f"there is no {file}\nSay where the gateway keeps it: --data-dir, or METAROS_MASTER_KEY.")
    with local_store(data_dir, store) as here:
        old, new = rekey.begin(file)
        done = here.change("master.rekey", MASTER_KEY, lambda engine: rekey.reseal(engine, old, new))
        rekey.finish(file)
    if out.json:
        out.objects({"sealed": done.sealed, "foreign": list(done.foreign)})
        return
    out.line(f"a new master key: {counted(done.sealed, 'secret')} sealed by it")
    for name in done.foreign:
        out.note(f"{name} was sealed by another gateway's master key, and stays so")
