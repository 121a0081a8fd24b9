"""The output of `metaros alert`: rows, one alert in full, and a value beside what was expected of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from metaros.cli.shared.output import Output, counted, human_seconds, sanitize

__all__ = ["HEADINGS", "gauge", "number", "show_alert", "show_change", "span", "stamp", "state", "table_row"]

HEADINGS = ("Alert", "Robot", "Severity", "State", "What", "Opened (UTC)", "Times")
STYLES = {"error": "1;31", "warning": "33", "info": "36"}
CHANGES = {"opened": "▲", "escalated": "▲", "acknowledged": "·", "changed": "·", "resolved": "✓"}
GAUGE_CELLS = 34
DAY_S = 86_400.0
NONE = "–"


def table_row(item: Mapping[str, Any]) -> Sequence[object]:
    """An alert as a row under `HEADINGS`."""
    times = item["times"] if item["times"] > 1 else ""
    return (item["id"], item["robot"], item["severity"], state(item), item["title"], stamp(item["opened"]), times)


def state(item: Mapping[str, Any]) -> str:
    """How it stands, and why nobody is told of it."""
    word = str(item["state"])
    if word == "acknowledged" and item["acknowledged_by"]:
        word = f"acknowledged by {item['acknowledged_by']}"
    quiet = "silenced" if item["silence"] else "explained by another" if item["inhibited_by"] else ""
    return f"{word}, {quiet}" if quiet and item["state"] != "resolved" else word


def show_alert(out: Output, item: Mapping[str, Any], *, now_ns: int, origin: str) -> None:
    """All of one alert; its page on the dashboard is at `origin`."""
    mark = out.style("✓" if item["state"] == "resolved" else "▲", "32" if item["state"] == "resolved" else "31")
    out.line(f"{mark} {out.style(sanitize(item['title']), '1')}")
    if item["reason"] and item["reason"] != item["title"]:
        out.line(f"  {sanitize(item['reason'])}")
    if item["value"] is not None and (item["low"] is not None or item["high"] is not None):
        out.line()
        out.line(f"  {gauge(item['low'], item['high'], item['value'])}")
    out.line()
    facts = [(name, text) for name, text in _facts(out, item, now_ns, origin) if text]
    width = max(len(name) for name, _ in facts)
    for name, text in facts:
        out.line(f"  {out.style(name.ljust(width), '2')}  {text}")
    _show_findings(out, item)
    _show_remarks(out, item)
    if item["state"] == "open" and out.tty:
        out.line()
        out.note(f"take it: metaros alert ack {item['robot']}/{item['cause']}")


def _facts(out: Output, item: Mapping[str, Any], now_ns: int, origin: str) -> list[tuple[str, str]]:
    severity = out.style(item["severity"], STYLES.get(item["severity"], "0"))
    silence = f"{item['silence']} (nobody is told)" if item["silence"] else ""
    inhibited = f"{item['inhibited_by']} (nobody is told of this one)" if item["inhibited_by"] else ""
    opened = f"{stamp(item['opened'])} UTC, {_ago(item['opened'], now_ns)}"
    opened += f", for the {_ordinal(item['times'])} time" if item["times"] > 1 else ""
    resolved = f"{stamp(item['resolved'])} UTC {_by(item['resolved_by'])}" if item["resolved"] else ""
    taken = f"{stamp(item['acknowledged'])} UTC {_by(item['acknowledged_by'])}" if item["acknowledged"] else ""
    return [
        ("alert", sanitize(item["id"])),
        ("robot", sanitize(item["robot"])),
        ("severity", severity),
        ("state", sanitize(state(item))),
        ("cause", sanitize(item["cause"])),
        ("series", sanitize(item["series"])),
        ("found by", sanitize(f"{item['detector']}, score {item['score']:.2f}") if item["detector"] else ""),
        ("opened", opened),
        ("acknowledged", sanitize(taken)),
        ("assigned to", sanitize(item["assignee"])),
        ("resolved", sanitize(resolved)),
        ("silence", sanitize(silence)),
        ("explained by", sanitize(inhibited)),
        ("evidence", sanitize(f"metaros recording get {item['clip']}") if item["clip"] else ""),
        ("page", sanitize(f"{origin}{item['path']}")),
    ]


def _show_findings(out: Output, item: Mapping[str, Any]) -> None:
    findings = item.get("findings") or []
    if not findings:
        return
    out.line()
    rows = [
        (
            row["detector"],
            row["series"] or NONE,
            row["severity"] if row["active"] else "over",
            number(row["value"]),
            _expected(row["low"], row["high"]),
            stamp(row["at"]),
            row["reason"],
        )
        for row in findings
    ]
    names = ("Finding", "Series", "State", "Value", "Expected", "Since (UTC)", "Why")
    out.table(names, rows, right=(3,))


def _show_remarks(out: Output, item: Mapping[str, Any]) -> None:
    remarks = item.get("remarks") or []
    if not remarks:
        return
    out.line()
    rows = [(stamp(row["at"]), row["by"] or "metaros", row["kind"], row["text"] or NONE) for row in remarks]
    out.table(("When (UTC)", "Who", "What", "Text"), rows)


def show_change(out: Output, change: str, event: Mapping[str, Any]) -> None:
    """A change of an alert as one line."""
    data = event["data"]
    severity = str(data.get("severity", ""))
    robot = str(event.get("subject") or data.get("robot") or "")
    mark = out.style(CHANGES.get(change, "·"), "32" if change == "resolved" else STYLES.get(severity, "0"))
    word = out.style(severity.ljust(7), STYLES.get(severity, "0"))
    what = ": ".join(str(data[name]) for name in ("title", "reason") if data.get(name)) or str(data.get("cause", ""))
    alert = out.style(sanitize(str(data.get("alert", ""))), "2")
    time = str(event["time"])[11:19]
    out.line(f"{time}  {alert}  {mark} {change.ljust(12)}  {word}  {sanitize(robot).ljust(8)}  {sanitize(what)}")


def gauge(low: float | None, high: float | None, value: float) -> str:
    """The value on a line with what was expected, as `├────────┤        ●` or, without a lower bound, `─────┤    ●`."""
    text = f"{number(value)}, expected {_expected(low, high)}"
    known = [bound for bound in (low, high) if bound is not None]
    reach = max(abs(value - bound) for bound in known)
    left = min([value, *known]) - (reach if low is None else 0.0)
    right = max([value, *known]) + (reach if high is None else 0.0)
    if not 0 < right - left < float("inf"):
        return text

    def cell(at: float) -> int:
        return round((at - left) / (right - left) * (GAUGE_CELLS - 1))

    first, last = cell(left if low is None else low), cell(right if high is None else high)
    cells = [" "] * GAUGE_CELLS
    cells[first : last + 1] = "─" * (last - first + 1)
    if low is not None:
        cells[first] = "├"
    if high is not None:
        cells[last] = "┤" if last > first or low is None else "┼"
    cells[cell(value)] = "●"
    return f"{''.join(cells).rstrip()}  {text}"


def number(value: float | None) -> str:
    """Four digits that matter, as people read them; a dash where there is no number."""
    if value is None:
        return NONE
    if value and not 1e-3 <= abs(value) < 1e7:
        return f"{value:.3g}"
    text = f"{value:.{max(0, 3 - len(str(int(abs(value)))) + 1)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _expected(low: float | None, high: float | None) -> str:
    if low is None and high is None:
        return NONE
    if low is None:
        return f"up to {number(high)}"
    if high is None:
        return f"from {number(low)}"
    return number(low) if low == high else f"{number(low)} to {number(high)}"


def span(seconds: float) -> str:
    """5 s, 5 min, 1 h 30 min: as it was set."""
    return human_seconds(seconds).removesuffix(" 0 s").removesuffix(" 0 min") if seconds else NONE


def stamp(time: str | None) -> str:
    """2026-11-21T06:00:00.000Z as 11-21 06:00:00."""
    return time[5:19].replace("T", " ") if time else NONE


def _ago(time: str, now_ns: int) -> str:
    age_s = max(0.0, now_ns / 1e9 - datetime.fromisoformat(time).timestamp())
    return f"{counted(int(age_s // DAY_S), 'day')} ago" if age_s >= 2 * DAY_S else f"{human_seconds(age_s)} ago"


def _by(who: str) -> str:
    return f"by {who}" if who else "by itself"


def _ordinal(count: int) -> str:
    ending = "th" if 10 <= count % 100 <= 20 else {1: "st", 2: "nd", 3: "rd"}.get(count % 10, "th")
    return f"{count}{ending}"
