"""The output of `metaros function`: rows, one function in full, the result of a call, the runtime."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from metaros.cli.shared.gateway_http import path_part
from metaros.cli.shared.output import Output, counted, human_bytes, sanitize

__all__ = [
    "CALL_HEADINGS",
    "HEADINGS",
    "FunctionName",
    "call_row",
    "function_path",
    "function_row",
    "log_line",
    "milliseconds",
    "moment",
    "show_function",
    "show_outcome",
    "show_runtime",
]

NONE = "–"
HEADINGS = ("Function", "Handler", "Versions", "Aliases", "Calls (1 h)", "Errors", "p95", "Changed (UTC)")
CALL_HEADINGS = ("Began (UTC)", "Status", "By", "Version", "Took", "Cold start", "Memory", "Robot", "Error")
MARKS = ("START ", "END ", "REPORT ", "INIT_")
LEVELS = {
    "L3": "shut in: own network, files, processes, system calls",
    "L2": "shut in: files, TCP, system calls",
    "L1": "a process with limits",
    "L0": "a process with a timeout, nothing else",
}

FunctionName = Annotated[str, typer.Argument(metavar="NAME", help="The function's name.")]


def function_path(name: str, end: str = "") -> str:
    """Its place in the API."""
    return f"/api/v1/functions/{path_part(name)}{end}"


def function_row(item: Mapping[str, Any]) -> Sequence[object]:
    """A function as a row under `HEADINGS`."""
    stats = item["stats"]
    aliases = ", ".join(f"{one['name']} → {_leads(one)}" for one in item["aliases"])
    return (
        *(item["name"], item["handler"], item["versions"] or NONE, aliases or NONE),
        *(stats["invocations"], stats["errors"], milliseconds(stats["p95_ms"]), moment(item["modified"])),
    )


def call_row(item: Mapping[str, Any]) -> Sequence[object]:
    """A call as a row under `CALL_HEADINGS`."""
    error = f"{item['error_type']}: {item['error_message']}" if item["error_type"] else NONE
    cold = milliseconds(item["init_ms"]) if item["init_ms"] else NONE
    return (
        *(moment(item["began"], seconds=True), item["status"], item["kind"], item["version"]),
        *(milliseconds(item["duration_ms"]), cold, f"{item['max_memory_mb']} MB", item["robot"] or NONE),
        error if len(error) <= 80 else f"{error[:79]}…",
    )


def milliseconds(value: float | None) -> str:
    """`0.21 ms`, `1.5 s`; – for none."""
    if value is None:
        return NONE
    return f"{value:.3g} ms" if value < 999.5 else f"{value / 1000:.3g} s"


def moment(text: str, *, seconds: bool = False) -> str:
    """A time of the API, to the minute or second."""
    return text[: 19 if seconds else 16].replace("T", " ")


def show_function(out: Output, item: Mapping[str, Any], *, origin: str) -> None:
    """All of one; its page on the dashboard is at `origin`."""
    mark = out.style("●", "32" if item["state"] == "Active" else "31")
    out.line(f"{mark} {out.style(sanitize(item['name']), '1')}")
    if item["description"]:
        out.line(f"  {sanitize(item['description'])}")
    out.line()
    facts = [(name, text) for name, text in _facts(item, origin) if text]
    width = max(len(name) for name, _ in facts)
    for name, text in facts:
        out.line(f"  {out.style(name.ljust(width), '2')}  {sanitize(text)}")
    for one in item["triggers"]:
        off = "" if one["enabled"] else " (off)"
        out.line(f"  {out.style('called by'.ljust(width), '2')}  {sanitize(one['kind'])} {sanitize(one['title'])}{off}")


def _facts(item: Mapping[str, Any], origin: str) -> list[tuple[str, str]]:
    stats, tried, bounds = item["stats"], item["event_invoke"], item["concurrency"]
    reserved = "" if bounds["reserved"] is None else f"at most {bounds['reserved']} at a time"
    warm = f"{bounds['warm']} kept warm" if bounds["warm"] else ""
    did = f"{counted(stats['invocations'], 'call')}, {counted(stats['errors'], 'error')}"
    took = f", p50 {milliseconds(stats['p50_ms'])}, p99 {milliseconds(stats['p99_ms'])}" if stats["invocations"] else ""
    return [
        ("state", item["state"] + (f": {item['reason']}" if item["reason"] else "")),
        ("handler", f"{item['handler']} on {item['interpreter']}"),
        ("limits", f"{item['timeout_s']:g} s, {item['memory_mb']} MB, {item['disk_mb']} MB in /tmp"),
        ("code", f"{human_bytes(item['code_bytes'])}, {item['code_sha256']}"),
        ("aliases", ", ".join(f"{one['name']} → {_leads(one)}" for one in item["aliases"])),
        ("versions", " ".join(one["version"] for one in item["published"])),
        ("layers", " ".join(item["layers"])),
        ("variables", " ".join(sorted(item["environment"]))),
        ("workers", ", ".join(part for part in (reserved, warm) if part)),
        ("events", f"tried again {tried['most_retries']} times, for {_age(tried)}"),
        ("on success", tried["on_success"]),
        ("on failure", tried["on_failure"] or tried["dead_letter"]),
        ("last hour", f"{did}{took}"),
        ("waiting", counted(stats["waiting"], "event") if stats["waiting"] else ""),
        ("dead", counted(stats["dead_letters"], "dead letter") if stats["dead_letters"] else ""),
        ("page", f"{origin}/functions/{path_part(item['name'])}"),
    ]


def _age(tried: Mapping[str, Any]) -> str:
    age_s = float(tried["most_age_s"])
    return f"{age_s / 3600:g} h" if age_s >= 3600 else f"{age_s:g} s"


def _leads(alias: Mapping[str, Any]) -> str:
    """`3`, `3 (10 % 4)`."""
    weights = "".join(f", {share * 100:g} % {version}" for version, share in alias["weights"].items())
    return f"{alias['version']}{weights}"


def show_outcome(out: Output, done: Mapping[str, Any], *, tail: bool) -> None:
    """What a call returned, alone on standard output; how it went, and with `tail` its log, beside it."""
    if tail and done["log"]:
        for line in done["log"].rstrip("\n").split("\n"):
            out.note(f"│ {log_line(out, line)}")
    ok, payload = done["status"] == "ok", done["payload"]
    if ok:
        out.line(sanitize(payload) if isinstance(payload, str) else json.dumps(payload, indent=2, ensure_ascii=False))
    else:
        _show_error(out, done["error_type"], payload)
    cold = f" after a cold start of {milliseconds(done['init_ms'])}" if done["init_ms"] else ""
    mark = out.style("✓", "32") if ok else out.style("✗", "31")
    took = f"{milliseconds(done['duration_ms'])}{cold}, {done['max_memory_mb']} MB"
    version = f", version {done['version']}" if done["version"] else ""
    out.note(f"{mark} {done['status']} in {took}{version}")


def _show_error(out: Output, kind: str, payload: Any) -> None:
    document = payload if isinstance(payload, Mapping) else {}
    text = document.get("errorMessage", payload if isinstance(payload, str) else "")
    out.line(f"{out.style(sanitize(kind), '1;31')}: {sanitize(str(text))}")
    for frame in document.get("stackTrace") or ():
        for line in str(frame).rstrip("\n").split("\n"):
            out.line(f"  {sanitize(line)}")


def log_line(out: Output, text: str) -> str:
    """A line of a log; what the platform writes is dim."""
    shown = sanitize(text.replace("\t", "  ").replace("\xa0", " "))  # AWS's client indents tracebacks by hard spaces
    return out.style(shown, "2") if text.startswith(MARKS) else shown


def show_runtime(out: Output, item: Mapping[str, Any]) -> None:
    """The sandbox with its reasons, and the pools."""
    if item["trouble"] or not item["on"]:
        out.line(f"{out.style('✗', '31')} no function runs here: {sanitize(item['trouble'] or 'turned off')}")
    elif not item["started"]:
        out.line(f"{out.style('○', '2')} not started: the first call does, and finds out which sandbox there is")
    else:
        level = item["level"]
        out.line(f"{out.style('●', '32')} {out.style(level, '1')}  {LEVELS.get(level, '')}")
    out.line()
    for level in sorted(item["reasons"], reverse=True):
        reason = item["reasons"][level]
        mark = out.style("✓", "32") if reason == "ok" else out.style("✗", "31")
        out.line(f"  {mark} {level}  {LEVELS.get(level, '')}{'' if reason == 'ok' else f': {sanitize(reason)}'}")
    out.line(f"  least   {item['require']}")
    out.line(f"  runs    {item['interpreter']}{' by ' + item['entry'] if item['entry'] else ''}")
    out.line(f"  workers {item['workers']} of {item['most_workers']}, {item['memory_mb']} MB")
    names = ("Function", "Version", "Workers", "Busy", "Waiting", "Calls", "Cold starts", "Memory")
    rows = [
        (
            *(one["function"], one["version"], one["workers"], one["busy"], one["waiting"]),
            *(one["calls"], one["cold_starts"], f"{one['memory_mb']} MB"),
        )
        for one in item["pools"]
    ]
    if rows:
        out.line()
        out.table(names, rows, right=range(2, 8))
