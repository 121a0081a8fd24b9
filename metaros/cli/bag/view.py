"""How a recording is shown: facts for machines, a table for people."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import TYPE_CHECKING, Any

from metaros.cli.shared.output import counted, human_bytes

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output
    from metaros.record import Bag, BagTopic
    from metaros.wire import QoSProfile

__all__ = ["bag_facts", "missing_text", "print_bag"]

_WORDS = {
    "lost": "never arrived",
    "dropped": "dropped (the disk was too slow)",
    "paused": "came during a pause",
    "disk": "did not fit on the disk",
}


def bag_facts(bag: Bag) -> dict[str, Any]:
    """Everything `info` knows."""
    span_s = max(0, bag.last_ns - bag.first_ns) / 1e9
    accounts = [
        {"file": path.name, "topic": topic, "publisher": gid, **account} for path, topic, gid, account in bag.gaps()
    ]
    missing = _missing(accounts)
    return {
        "path": str(bag.path),
        "start_ns": bag.first_ns,
        "end_ns": bag.last_ns,
        "duration_s": span_s,
        "messages": bag.message_count,
        "size_bytes": sum(file.size_bytes for file in bag.files),
        "uncompressed_bytes": sum(chunk.uncompressed_size for file in bag.files for chunk in file.chunks),
        "compression": sorted({chunk.compression or "none" for file in bag.files for chunk in file.chunks}),
        "files": [
            {
                "path": file.path.name,
                "messages": file.message_count,
                "size_bytes": file.size_bytes,
                "chunks": len(file.chunks),
                "library": file.library,
                "damage": file.damage,
            }
            for file in bag.files
        ],
        "topics": [_topic_facts(topic, span_s, missing.get(topic.name, {})) for topic in bag.topics],
        "accounted": bool(accounts),
        "publishers": accounts,
    }


def _topic_facts(topic: BagTopic, span_s: float, missing: Mapping[str, int]) -> dict[str, Any]:
    return {
        "topic": topic.name,
        "type": topic.type_name,
        "hash": topic.type_hash,
        "messages": topic.messages,
        "rate_hz": topic.messages / span_s if span_s else 0.0,
        "missing": dict(missing),
        "schema": bool(topic.schema),
        "qos": [_qos_text(qos) for qos in topic.qos],
    }


def _missing(accounts: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, int]]:
    """By topic and reason."""
    found: dict[str, dict[str, int]] = {}
    for account in accounts:
        for reason in _WORDS:
            for first, last in account.get(reason, ()):
                row = found.setdefault(account["topic"], {})
                row[reason] = row.get(reason, 0) + last - first + 1
        for loss in account.get("losses", ()):  # of a file that a gateway made of its history
            row = found.setdefault(account["topic"], {})
            row[loss["reason"]] = row.get(loss["reason"], 0) + loss["count"]
    return found


def print_bag(out: Output, facts: Mapping[str, Any], *, verbose: bool) -> None:
    """The table."""
    _print_head(out, facts)
    rows = [
        (
            topic["topic"],
            topic["type"] if topic["schema"] else f"{topic['type']} (no schema)",
            str(topic["messages"]),
            f"{topic['rate_hz']:.1f}",
            str(sum(topic["missing"].values()) or "-") if facts["accounted"] else "?",
            ", ".join(topic["qos"]),
        )
        for topic in facts["topics"]
    ]
    out.line()
    out.table(("Topic", "Type", "Messages", "Hz", "Gaps", "QoS"), rows, right=(2, 3, 4), empty="no topics")
    if verbose:
        _print_verbose(out, facts)


def missing_text(missing: Mapping[str, Mapping[str, int]]) -> str:
    """`12 on 3 topics: 10 never arrived, 2 came during a pause`; empty when nothing is missing."""
    reasons: dict[str, int] = {}
    for row in missing.values():
        for reason, count in row.items():
            reasons[reason] = reasons.get(reason, 0) + count
    if not reasons:
        return ""
    parts = ", ".join(f"{count} {_WORDS.get(reason, reason)}" for reason, count in reasons.items())
    return f"{sum(reasons.values())} on {counted(len(missing), 'topic')}: {parts}"


def _print_head(out: Output, facts: Mapping[str, Any]) -> None:
    start = datetime.fromtimestamp(facts["start_ns"] // 10**9).strftime("%Y-%m-%d %H:%M:%S")
    files = facts["files"]
    size, raw = facts["size_bytes"], facts["uncompressed_bytes"]
    ratio = f", {size / raw:.0%} of {human_bytes(raw)}" if raw else ""
    compression = "+".join(facts["compression"]) or "none"
    gaps = missing_text({topic["topic"]: topic["missing"] for topic in facts["topics"] if topic["missing"]})
    gaps = out.style(gaps, "33") if gaps else "none: every sequence number is there"
    rows = [
        ("recording", facts["path"]),
        ("start", f"{start}, {facts['duration_s']:.1f} s"),
        ("messages", f"{facts['messages']} on {counted(len(facts['topics']), 'topic')}"),
        ("size", f"{human_bytes(size)} in {counted(len(files), 'file')}{ratio} ({compression})"),
        ("gaps", gaps if facts["accounted"] else "not known: no account of them in it"),
    ]
    for name, text in rows:
        out.line(f"{out.style(name.ljust(10), '1')} {text}")
    for file in files:
        if file["damage"]:
            out.line(out.style(f"{'damaged'.ljust(10)} {file['path']}: {file['damage']}", "31"))
            out.line(f"{''.ljust(10)} all listed here is readable; `metaros bag recover` makes a sound file of it")


def _print_verbose(out: Output, facts: Mapping[str, Any]) -> None:
    out.line()
    rows = [
        (
            account["topic"],
            account["publisher"][:8],
            account["file"],
            f"{account['first']}..{account['last']}",
            str(account["received"]),
            _account_text(account),
        )
        for account in facts["publishers"]
    ]
    out.table(("Topic", "Publisher", "File", "Sequence", "Recorded", "Missing"), rows, right=(4,))
    out.line()
    files = [(f["path"], str(f["messages"]), str(f["chunks"]), human_bytes(f["size_bytes"])) for f in facts["files"]]
    out.table(("File", "Messages", "Chunks", "Size"), files, right=(1, 2, 3))


def _account_text(account: Mapping[str, Any]) -> str:
    parts = [f"{reason} {_ranges(account[reason])}" for reason in _WORDS if reason in account]
    parts += [f"{loss['reason']} {loss['count']}" for loss in account.get("losses", ())[:5]]
    return " ".join(parts) or "-"


def _ranges(pairs: list[list[int]]) -> str:
    shown = [str(first) if first == last else f"{first}-{last}" for first, last in pairs[:5]]
    return ",".join(shown) + (" …" if len(pairs) > 5 else "")


def _qos_text(qos: QoSProfile) -> str:
    from metaros.wire import Durability, History, Reliability

    parts = ["best effort" if qos.reliability is Reliability.BEST_EFFORT else "reliable"]
    if qos.durability is Durability.TRANSIENT_LOCAL:
        parts.append("latched")
    parts.append("keep all" if qos.history is History.KEEP_ALL else f"depth {qos.depth}")
    return " ".join(parts)
