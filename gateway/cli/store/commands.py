"""`metaros gateway store`: look after what a gateway has stored, beside it or without it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli.options import DataDir, EventRetentionDays, ObjectsUrl, RetentionDays, RetentionMib, RetentionRules
from gateway.cli.options import StoreUrl as StoreUrlOption
from gateway.cli.store.migrate import migrate
from gateway.cli.store.view import show_plan, show_report, show_stats
from gateway.settings import MIB, Settings, default_data_dir
from metaros.cli.shared.options import Format, FormatOption
from metaros.errors import ConfigError

if TYPE_CHECKING:
    from gateway.store.engine import StoreEngine
    from gateway.store.objects import ObjectStore
    from gateway.store.storage import Storage
    from metaros.clock import Clock

__all__ = ["register"]

SHOWN_OBJECTS = 50
Deep = Annotated[bool, typer.Option("--deep", help="Read every object through and compare its checksum and samples.")]
DeleteOrphans = Annotated[bool, typer.Option("--delete-orphans", help="Delete objects that the store does not know.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Only show what would be deleted, and why.")]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Opened:
    """The two stores of a gateway, and what it keeps of them."""

    engine: StoreEngine
    objects: ObjectStore
    storage: Storage
    clock: Clock


def register(gateway: typer.Typer) -> None:
    """Add the noun to `metaros gateway`."""
    store = typer.Typer(
        no_args_is_help=True, help="Check, compact and measure what a gateway stores; it may be running."
    )
    for name, command in (("check", _check), ("compact", _compact), ("stats", _stats), ("retention", _retention)):
        store.command(name)(command)
    store.command("migrate")(migrate)
    gateway.add_typer(store, name="store")


def _check(
    deep: Deep = False,
    delete_orphans: DeleteOrphans = False,
    data_dir: DataDir = None,
    store: StoreUrlOption = "",
    objects: ObjectsUrl = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Name what is damaged: objects that are missing or differ, samples that are nowhere or twice. Exit code 1 then."""
    from gateway.store.integrity import check as checking
    from gateway.store.ledger import in_transaction
    from gateway.store.object_store_marker import check_marker
    from metaros.cli.shared.output import Output

    out = Output(output)
    with _opened(data_dir, store, objects) as it:
        run, now_ns = in_transaction(it.engine), it.clock.wall_ns()
        report = checking.check(it.engine, it.objects, deep=deep, now_ns=now_ns, on_object=_progress)
        gone = 0
        if delete_orphans:
            check_marker(it.engine, run, it.objects, clock=it.clock)  # another store's objects are no orphans
            gone = checking.delete_orphans(run, it.objects, report, now_ns=now_ns)
            report.orphans = [item for item in report.orphans if not str(item.object).startswith(checking.OURS)]
        run(lambda engine: checking.remember(engine, report))
    show_report(out, report, gone)
    if report.damage:
        raise typer.Exit(1)


def _compact(
    data_dir: DataDir = None, store: StoreUrlOption = "", objects: ObjectsUrl = "", output: FormatOption = Format.TEXT
) -> None:
    """Move all received batches into segments now, and delete what is doomed."""
    from gateway.store.ledger import in_transaction, sweep_objects
    from gateway.store.object_store_marker import check_marker
    from gateway.store.telemetry.compact import Compaction
    from metaros.cli.shared.output import Output, counted

    out = Output(output)
    with _opened(data_dir, store, objects) as it:
        run = in_transaction(it.engine)
        check_marker(it.engine, run, it.objects, clock=it.clock)
        work = Compaction(it.engine, run, it.objects, clock=it.clock)
        batches = segments = 0
        for due in work.due(everything=True):
            while moved := work.compact(due):
                batches, segments = batches + moved, segments + 1
        swept = sweep_objects(run, it.objects, now_ns=it.clock.wall_ns())
    if out.json:
        out.objects({"batches": batches, "segments": segments, "deleted": swept})
        return
    out.line(f"{counted(batches, 'batch')} into {counted(segments, 'segment')}, {counted(swept, 'object')} deleted")


def _stats(
    data_dir: DataDir = None,
    store: StoreUrlOption = "",
    objects: ObjectsUrl = "",
    retention_days: RetentionDays = 7.0,
    event_retention_days: EventRetentionDays = 90.0,
    retention_mib: RetentionMib = 4096,
    retention: RetentionRules = None,
    output: FormatOption = Format.TEXT,
) -> None:
    """How much is stored by class, robot and table, how fast it grows, and when the disk is full."""
    from metaros.cli.shared.output import Output

    out = Output(output)
    bounds = _bounds(retention_days, event_retention_days, retention_mib, retention)
    with _opened(data_dir, store, objects, **bounds) as it:
        document = it.storage.document(it.engine, now_ns=it.clock.wall_ns())
    if out.json:
        out.objects(document)
        return
    show_stats(out, document)


def _retention(
    dry_run: DryRun = False,
    data_dir: DataDir = None,
    store: StoreUrlOption = "",
    objects: ObjectsUrl = "",
    retention_days: RetentionDays = 7.0,
    event_retention_days: EventRetentionDays = 90.0,
    retention_mib: RetentionMib = 4096,
    retention: RetentionRules = None,
    output: FormatOption = Format.TEXT,
) -> None:
    """Delete what is too old or too much now; with --dry-run only say what that is."""
    from gateway.store.ledger import in_transaction, sweep_objects
    from gateway.store.object_store_marker import check_marker
    from gateway.store.purge import Purge
    from metaros.cli.shared.output import Output

    out = Output(output)
    bounds = _bounds(retention_days, event_retention_days, retention_mib, retention)
    with _opened(data_dir, store, objects, **bounds) as it:
        now_ns = it.clock.wall_ns()
        document = it.storage.plan_document(it.engine, now_ns=now_ns)
        if not dry_run:
            check_marker(it.engine, in_transaction(it.engine), it.objects, clock=it.clock)
            purge = Purge(it.engine, it.storage.retention, now_ns=now_ns)
            while purge.step():
                pass
            while sweep_objects(in_transaction(it.engine), it.objects, now_ns=now_ns):
                pass
    if out.json:
        out.objects({**document, "deleted": not dry_run})
        return
    show_plan(out, document, dry_run=dry_run)


def _bounds(days: float, event_days: float, mib: int, rules: list[str] | None) -> dict[str, Any]:
    return {
        "retention_days": days,
        "event_retention_days": event_days,
        "retention_bytes": mib * MIB,
        "retention_rules": tuple(rules or ()),
    }


@contextmanager
def _opened(data_dir: Path | None, store: str, objects: str, **bounds: Any) -> Iterator[_Opened]:
    """The stores, closed afterwards.

    Raises:
        ConfigError: there is none; it is not made by looking at it.
    """
    from gateway.store.engines import open_engine
    from gateway.store.objects import open_objects
    from gateway.store.retention import retention_of
    from gateway.store.sqlite import DATABASE
    from gateway.store.storage import Storage
    from metaros.clock import SystemClock

    folder = data_dir or default_data_dir()
    settings = Settings(data_dir=folder, store_url=store, objects_url=objects, **bounds)
    if not store and not (folder / DATABASE).exists():
        raise ConfigError(f"there is no store in {folder}\nSay where the gateway keeps it: --data-dir, or --store.")
    kept = open_objects(objects, folder)
    engine, _ = open_engine(store, folder)
    try:
        storage = Storage(retention=retention_of(settings), objects=kept, data_dir=folder)
        yield _Opened(engine=engine, objects=kept, storage=storage, clock=SystemClock())
    finally:
        engine.close()
        kept.close()


def _progress(done: int, total: int) -> None:
    """On a terminal, of what takes a while; the line goes again."""
    if total >= SHOWN_OBJECTS and sys.stderr.isatty():
        text = f"\r{done} of {total} objects" if done < total else "\r\x1b[K"
        print(text, end="", file=sys.stderr, flush=True)
