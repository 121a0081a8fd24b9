"""`metaros gateway backup`: everything a gateway has stored as a folder, and a store made of it again."""

from __future__ import annotations

import getpass
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli.options import DataDir, ObjectsUrl
from gateway.cli.options import StoreUrl as StoreUrlOption
from gateway.settings import default_data_dir
from metaros.cli.shared.options import Format, FormatOption

if TYPE_CHECKING:
    from gateway.backup.restore import Restored
    from metaros.cli.shared.output import Output

__all__ = ["register"]

SHOWN = 50  # objects, files, tables or pages of the database
Folder = Annotated[Path, typer.Argument(metavar="DIR", help="The backup: a folder.")]
WithKey = Annotated[
    bool, typer.Option("--with-master-key", help="Put master.key in it; who has the backup then has every secret.")
]


def register(gateway: typer.Typer) -> None:
    """Add the noun to `metaros gateway`."""
    backup = typer.Typer(no_args_is_help=True, help="Back up what a gateway stores, which may be running; restore it.")
    for name, command in (("take", _take), ("verify", _verify), ("restore", _restore)):
        backup.command(name)(command)
    gateway.add_typer(backup, name="backup")


def _take(
    folder: Folder,
    with_master_key: WithKey = False,
    data_dir: DataDir = None,
    store: StoreUrlOption = "",
    objects: ObjectsUrl = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Copy the database of this moment and every object that it refers to into a new folder. The gateway may run."""
    from gateway.backup.manifest import moment
    from gateway.backup.snapshot import open_existing
    from gateway.backup.take import take
    from gateway.identity.master import key_file
    from gateway.store.objects import open_objects
    from metaros.cli.shared.output import Output, counted, human_bytes
    from metaros.clock import SystemClock

    out, home = Output(output), data_dir or default_data_dir()
    engine, kept = open_existing(store, home), open_objects(objects, home)
    try:
        manifest = take(
            engine,
            kept,
            folder,
            where=str(home),
            data_dir=home,
            with_master_key=with_master_key,
            clock=SystemClock(),
            on_step=_Progress(),
        )
    finally:
        engine.close()
        kept.close()
    if out.json:
        out.objects({"backup": str(folder), **_document(manifest)})
    else:
        size = human_bytes(manifest.size_bytes)
        out.line(f"{folder}: the store of {moment(manifest.taken_ns)}, {counted(manifest.objects, 'object')}, {size}")
        for name in manifest.damaged:
            out.line(f"damaged in the store, and not in the backup: {name}")
        if manifest.master_key and not with_master_key:
            out.note(f"{key_file(home)} is not in it: keep that elsewhere, without it the secrets are lost")
    if manifest.damaged:
        raise typer.Exit(1)


def _verify(folder: Folder, output: FormatOption = Format.TEXT) -> None:
    """Read a backup through: checksums, the database, and every object that it refers to. Exit code 1 if damaged."""
    from gateway.backup.manifest import moment
    from gateway.backup.verify import verify
    from metaros.cli.shared.output import Output, counted

    out = Output(output)
    found = verify(folder, on_step=_Progress())
    if out.json:
        out.objects({**_document(found.manifest), "files": found.files, "faults": list(found.faults)})
    else:
        for fault in found.faults:
            out.line(fault)
        for name in found.manifest.damaged:
            out.line(f"was damaged in the store already: {name}")
        state = f"{counted(len(found.faults), 'fault')}" if found.faults else "whole"
        when = moment(found.manifest.taken_ns)
        out.line(f"{folder}: the store of {when}, {counted(found.files, 'file')} read through: {state}")
    if found.faults:
        raise typer.Exit(1)


def _restore(
    folder: Folder,
    data_dir: DataDir = None,
    store: StoreUrlOption = "",
    objects: ObjectsUrl = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Make a store of a backup, where there is none and no gateway runs. Run it again if it was broken off."""
    from gateway.backup.restore import restore
    from gateway.store.objects import open_objects
    from metaros.cli.shared.output import Output
    from metaros.clock import SystemClock

    out, home = Output(output), data_dir or default_data_dir()
    kept = open_objects(objects, home)
    try:
        done = restore(
            folder, kept, url=store, data_dir=home, clock=SystemClock(), who=getpass.getuser(), on_step=_Progress()
        )
    finally:
        kept.close()
    if out.json:
        out.objects({**_document(done.manifest), "sent": done.sent, "keyless": done.keyless, **_counts(done)})
    else:
        _show(out, done, home)


def _show(out: Output, done: Restored, home: Path) -> None:
    """What was restored, what was ended by it, and what nobody but its people can know."""
    from gateway.backup.manifest import moment
    from gateway.identity.master import key_file
    from metaros.cli.shared.output import counted

    invalidated, when = done.invalidated, moment(done.manifest.taken_ns)
    out.line(f"restored the store of {when}: {counted(done.manifest.objects, 'object')}, {done.sent} of them sent")
    out.line(
        f"ended: {counted(invalidated.sessions, 'sign-in')}, {counted(invalidated.tokens, 'enrolment token')};"
        f" paused: {counted(invalidated.rollouts, 'rollout')}"
    )
    out.line(
        f"valid as at that time: {counted(invalidated.users, 'user')}, {counted(invalidated.keys, 'API key')},"
        f" {counted(invalidated.robots, 'enrolled robot')}"
    )
    out.line("Whoever was removed or revoked since then gets in again: remove and revoke them before robots and")
    out.line("people reach the gateway: metaros user list, metaros key list, metaros enrol list.")
    if done.keyless:
        out.note(f"put the master key back before the gateway starts: {key_file(home)}")


def _counts(done: Restored) -> dict[str, Any]:
    from dataclasses import asdict

    return asdict(done.invalidated)


def _document(manifest: Any) -> dict[str, Any]:
    from gateway.backup.manifest import moment

    return {
        "store_id": manifest.store_id,
        "taken": moment(manifest.taken_ns),
        "database": manifest.database,
        "schema": manifest.schema,
        "version": manifest.version,
        "objects": manifest.objects,
        "bytes": manifest.size_bytes,
        "damaged": manifest.damaged,
        "with_master_key": manifest.with_master_key,
    }


class _Progress:
    """On a terminal, of what takes a while; the line goes again."""

    def __init__(self) -> None:
        self._shown = False

    def __call__(self, what: str, done: int, total: int) -> None:
        if done < total and total >= SHOWN and sys.stderr.isatty():
            self._shown = True
            print(f"\r\x1b[K{what}: {done} of {total}", end="", file=sys.stderr, flush=True)
        elif done >= total and self._shown:
            self._shown = False
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
