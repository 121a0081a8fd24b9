"""`metaros agent status`: how the agents of this machine do, and what waits in their outboxes."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, ZenohPort

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output

__all__ = ["ask", "rows_of", "status_command"]

_COLUMNS = ("Class", "Fresh", "Back-fill", "Samples", "Oldest", "On disk", "Quota", "Full", "Lost")
_PATIENCE_S = 2.0
_MOST_BYTES = 1024 * 1024  # of an answer
_LABEL = 9
_TEXTS = ("name", "namespace", "version", "directory", "transport", "gateway", "store_id")
_NUMBERS = ("fresh_bytes", "backfill_bytes", "samples", "lost", "disk_bytes", "quota_bytes")
_BOX = ("from_ns", "to_ns", "size_bytes", "quota_bytes", "lost")
Report = dict[str, Any]


def status_command(
    name: Annotated[str | None, typer.Option(help="Only this robot's agent.")] = None,
    state_dir: Annotated[Path | None, typer.Option(help="The agent's state directory, if it is not the usual.")] = None,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Show each agent: its link, and what waits by class. Exit code 1 where there is none.

    A running agent is asked; of one that does not run the state directory is read.
    """
    from metaros.cli.shared.output import Output

    out = Output(output)
    asked = ask(zenoh_port, domain)
    reports = [report for report in asked if name in (None, report["name"])]
    known = {Path(report["directory"]).resolve() for report in asked}
    unknown = (path for path in directories(name, state_dir) if path.resolve() not in known)
    left = [found for path in unknown for found in read(path)]
    answered = {report["name"] for report in asked}
    reports += [one for one in left if one["name"] not in answered or held(one)]
    if state_dir is not None:
        reports = [report for report in reports if Path(report["directory"]).resolve() == state_dir.resolve()]
    reports.sort(key=lambda report: str(report["name"]))
    if out.json:
        out.objects(reports)
    for report in reports if not out.json else ():
        show(out, report)
    if not reports:
        if not out.json:
            which = f"no agent {name!r}" if name else "no agent"
            out.note(f"{which} runs here, and none has left anything; start one: metaros agent --name NAME")
        raise typer.Exit(1)


def ask(zenoh_port: int, domain: int) -> list[Report]:
    """What the agents on this machine's router answer; none where there is no router."""
    from metaros.cli.shared.connection import open_graph_and_session
    from metaros.errors import UnavailableError

    try:
        with open_graph_and_session(zenoh_port, domain, spin_time=0.0) as (session, _):
            import zenoh

            replies = session.check_open().get(
                f"@metaros/{session.domain}/*/agent",
                timeout=_PATIENCE_S,
                consolidation=zenoh.ConsolidationMode.NONE,
            )
            answers = [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]
    except UnavailableError:
        return []
    return list(rows_of(answers))


def rows_of(answers: Iterable[bytes]) -> Iterable[Report]:
    """The answers that are reports, with what we know of them; a peer's answer is data from outside."""
    for answer in answers:
        try:
            said: Any = json.loads(answer) if len(answer) <= _MOST_BYTES else None
            report: Report = {name: text(said[name]) for name in _TEXTS}
            report |= {name: int(said[name]) for name in ("pid", "reconnects", "disk_free_bytes")}
            report |= {
                "running": True,
                "linked": said["linked"] is True,
                "sent_bytes_per_s": float(said["sent_bytes_per_s"]),
            }
            report["budget_bytes_per_s"] = maybe(said["budget_bytes_per_s"])
            report["epochs"] = [text(epoch) for epoch in said["epochs"][:64]]
            report["classes"] = [
                {
                    "name": text(row["name"]),
                    **{name: int(row[name]) for name in _NUMBERS},
                    "oldest_ns": maybe(row["oldest_ns"]),
                }
                for row in said["classes"][:8]
            ]
            box, waiting = said.get("black_box") or {}, said.get("recordings") or {}
            report["black_box"] = {name: int(box.get(name, 0)) for name in _BOX}
            report["recordings"] = {name: int(waiting.get(name, 0)) for name in ("count", "size_bytes")}
            twin = said.get("twin") or {}
            report["twin"] = {name: int(twin.get(name, 0)) for name in ("revision", "applied")}
            report["twin"] |= {name: text(twin.get(name, "")) for name in ("state", "code", "message")}
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError):
            continue
        yield report


def text(value: object) -> str:
    """A text from outside: no longer than a line, and nothing that moves a terminal's cursor."""
    return "".join(letter if letter.isprintable() else "?" for letter in str(value)[:256])


def maybe(value: Any) -> int | None:
    """A number or none."""
    return None if value is None else int(value)


def directories(name: str | None, state_dir: Path | None) -> list[Path]:
    """Where agents may have left something."""
    from edge_agent.state.state_dir import default_state_dir

    if state_dir is not None:
        return [state_dir]
    if name is not None:
        return [default_state_dir(name)]
    home = default_state_dir("x").parent
    return [path for path in home.iterdir() if path.is_dir()] if home.is_dir() else []


def read(directory: Path) -> list[Report]:
    """The report of a directory with an outbox, if it is one. A held lock means that an agent runs out of our sight."""
    from edge_agent.status.report import held_report
    from metaros.concurrency.file_lock import take_lock

    if not (directory / "outbox").is_dir():
        return []
    report, lock = held_report(directory), directory / "lock"
    if lock.exists():
        descriptor = os.open(lock, os.O_RDWR)
        try:
            report["running"] = not take_lock(descriptor)
        finally:
            os.close(descriptor)
    return [report]


def show(out: Output, report: Report) -> None:
    """One agent."""
    from metaros.cli.shared.output import human_bytes

    out.line(f"{out.style(str(report['name']), '1;36')}  {headline(out, report)}")
    if not report["running"] and not held(report):
        out.line(f"  {out.style('State'.ljust(_LABEL), '2')} {report['directory']}")
        out.line()
        return
    limit = report.get("budget_bytes_per_s")
    uplink = f"limited to {human_bytes(limit)}/s" if limit else "no limit"
    if report.get("linked"):
        uplink = f"{human_bytes(report['sent_bytes_per_s'])}/s, {uplink}"
    epochs = report.get("epochs") or []
    rows = (
        ("Uplink", uplink),
        ("Store", report.get("store_id") or "none yet: no gateway has taken it"),
        ("Epoch", ", ".join(map(str, epochs[-4:])) or "–"),
        ("State", f"{report['directory']}, {human_bytes(report['disk_free_bytes'])} free"),
        ("Twin", twin_line(report.get("twin") or {})),
        ("Black box", box_line(report.get("black_box") or {}, report["running"])),
    )
    for label, value in rows:
        out.line(f"  {out.style(label.ljust(_LABEL), '2')} {value}")
    if (waiting := report.get("recordings") or {}).get("count"):
        size = human_bytes(waiting["size_bytes"])
        out.line(f"  {out.style('Clips'.ljust(_LABEL), '2')} {waiting['count']} wait for the gateway, {size}")
    out.line()
    out.table(_COLUMNS, lines(report["classes"]), right=range(1, len(_COLUMNS)))
    out.line()


def twin_line(twin: Report) -> str:
    """The twin's state, in words."""
    if not twin.get("revision"):
        return "none: the robot's own settings"
    lives_by = f"revision {twin['applied']}" if twin["applied"] else "the robot's own settings"
    if twin["state"] == "applied":
        return lives_by
    if twin["state"] == "on trial":
        return f"{lives_by}, on trial until the gateway confirms it"
    return f"{lives_by}; revision {twin['revision']} was {twin['state']}: {text(twin['message'] or twin['code'])}"


def box_line(box: Report, running: bool) -> str:
    """The black box in words."""
    from metaros.cli.shared.output import human_bytes, human_seconds

    if not box.get("size_bytes") or not box["to_ns"]:
        return "empty" if box.get("quota_bytes") else "off" if running else "empty"
    if not box["from_ns"]:
        return f"{human_bytes(box['size_bytes'])}, until {age(box['to_ns'])}"
    span = human_seconds(max(0, box["to_ns"] - box["from_ns"]) / 1e9)
    lost = f", {box['lost']:,} lost" if box["lost"] else ""
    return f"the last {span}, {human_bytes(box['size_bytes'])} of {human_bytes(box['quota_bytes'])}{lost}"


def held(report: Report) -> bool:
    """Whether anything waits."""
    return any(row["samples"] for row in report["classes"]) or bool((report.get("recordings") or {}).get("count"))


def headline(out: Output, report: Report) -> str:
    """Whether it runs and is linked, in words."""
    if "linked" not in report:
        if report["running"]:
            return out.style("runs, but does not answer on this router", "33")
        return out.style("does not run", "33") + ("; what it left:" if held(report) else ", and holds nothing")
    pid = f"pid {report['pid']}, agent {report.get('version', '?')}, namespace {report.get('namespace', '?')}"
    again = report.get("reconnects") or 0
    lost = f", link lost {again}×" if again else ""
    if report["linked"]:
        return f"{out.style('linked', '32')} to {report['gateway']} by {report['transport']}{lost}, {pid}"
    return f"{out.style('no link', '31')}: tries {report.get('gateway') or 'its gateways'}{lost}, {pid}"


def lines(classes: Iterable[Report]) -> list[tuple[str, ...]]:
    """A row for each class; a dash for nothing."""
    from metaros.cli.shared.output import human_bytes

    rows = []
    for row in classes:
        fresh, late, disk, quota = (
            int(row[key]) for key in ("fresh_bytes", "backfill_bytes", "disk_bytes", "quota_bytes")
        )
        used = disk if row["name"] != "live" else fresh
        rows.append(
            (
                str(row["name"])[:16],
                *(human_bytes(size) if size else "–" for size in (fresh, late)),
                f"{int(row['samples']):,}" if row["samples"] else "–",
                age(row.get("oldest_ns")),
                human_bytes(disk) if disk else "–",
                human_bytes(quota),
                f"{used / quota:.0%}" if quota and used >= quota / 200 else "–",
                f"{int(row['lost']):,}" if row["lost"] else "–",
            )
        )
    return rows


def age(wall_ns: int | None) -> str:
    """How long ago that was."""
    from metaros.cli.shared.output import human_seconds
    from metaros.clock import SystemClock

    if not wall_ns:
        return "–"
    seconds = (SystemClock().wall_ns() - int(wall_ns)) / 1e9
    return f"{human_seconds(seconds)} ago" if seconds >= 0 else "in the future"
