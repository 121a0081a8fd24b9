"""The output of `metaros gateway store`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from metaros.cli.shared.output import Output, counted, human_bytes

if TYPE_CHECKING:
    from gateway.store.integrity.check import Damage, Report

__all__ = ["show_plan", "show_report", "show_stats"]


def show_report(out: Output, report: Report, gone: int) -> None:
    """What a check found; `gone` orphans were deleted."""
    from gateway.store.storage import damage_document

    if out.json:
        out.objects(
            {
                "deep": report.deep,
                "objects": report.objects,
                "bytes": report.size_bytes,
                "streams": report.streams,
                "damaged": [damage_document(item) for item in report.damage],
                "orphans": [item.object for item in report.orphans],
                "deleted_orphans": gone,
            }
        )
        return
    looked = (
        f"{counted(report.objects, 'object')} ({human_bytes(report.size_bytes)}), {counted(report.streams, 'stream')}"
    )
    how = "read through" if report.deep else "looked at"
    out.line(f"{looked} {how}: {counted(len(report.damage), 'fault') if report.damage else 'nothing is damaged'}")
    if report.damage or report.orphans:
        rows = [_row(item) for item in [*report.damage, *report.orphans]]
        out.table(("what", "robot", "topic", "from", "to", "object"), rows)
    if gone:
        out.line(f"{counted(gone, 'orphan')} deleted")


def _row(item: Damage) -> tuple[str, ...]:
    from gateway.store.storage import damage_document

    shown = damage_document(item)
    return tuple(str(shown[key] or "-") for key in ("what", "robot", "topic", "start", "end", "object"))


def show_stats(out: Output, document: dict[str, Any]) -> None:
    """The account of a store, as REST gives it."""

    def size(value: float | None) -> str:
        return "-" if value is None else human_bytes(value)

    def days(value: float | None) -> str:
        return "never" if value is None else f"in {value:.1f} days"

    rows = [
        (
            item["class"],
            size(item["bytes"]),
            item["oldest"] or "-",
            "-" if item["keep_days"] is None else f"{item['keep_days']:g} days",
            size(item["keep_bytes"]),
        )
        for item in document["classes"]
    ]
    out.table(("class", "size", "oldest", "kept", "at most"), rows, right={1, 4})
    out.line()
    out.table(("robot", "size"), [(item["robot"], size(item["bytes"])) for item in document["robots"]], right={1})
    out.line()
    tables = [(item["table"], str(item["rows"]), size(item["bytes"])) for item in document["tables"]]
    out.table(("table", "rows", "size"), tables, right={1, 2})
    objects = document["objects"]
    out.line()
    out.line(f"objects  {objects['stored']} with {size(objects['bytes'])} in {objects['where']}")
    out.line(f"total    {size(document['total_bytes'])} of {size(document['keep_bytes'])}")
    if document["growth_bytes_per_day"] is None:
        out.line("growth   known after an hour")
        return
    growth, bound = size(document["growth_bytes_per_day"]), days(document["days_until_bound"])
    out.line(f"growth   {growth} a day; the bound is reached {bound}")
    out.line(f"disk     {size(document['disk_free_bytes'])} free; full {days(document['days_until_full'])}")


def show_plan(out: Output, document: dict[str, Any], *, dry_run: bool) -> None:
    """What the retention deletes, or would."""
    word = "would go" if dry_run else "gone"
    if not document["items"] and not document["gaps"]:
        out.line("nothing is too old or too much")
        return
    rows = [
        (item["class"], item["why"], str(item["count"]), human_bytes(item["bytes"]), item["oldest"], item["newest"])
        for item in document["items"]
    ]
    out.table(("class", "why", "rows and objects", "size", "oldest", "newest"), rows, right={2, 3})
    out.line(f"{human_bytes(document['bytes'])} {word}, and {document['gaps']} records of losses")
