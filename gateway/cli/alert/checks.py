"""`metaros alert checks …`: what is looked for, what is learned, who is told, and what is silenced."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from gateway.cli.alert.view import number, span, stamp
from gateway.cli.time_span import span_s
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, sanitize
from metaros.errors import PeerError, UsageError

__all__ = ["register"]

METER_CELLS = 12
THRESHOLD = 0.5
CheckId = Annotated[str, typer.Argument(metavar="CHECK", help="Its id, as `metaros alert checks` shows it.")]
Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="The robot's id.")]


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    commands = (
        ("silences", _silences),
        ("unsilence", _unsilence),
        ("checks", _checks),
        ("check", _check),
        ("learning", _learning),
        ("routes", _routes),
        ("test-notice", _test_notice),
    )
    for name, command in commands:
        noun.command(name)(command)


def _silences(gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """What nobody is told of now, until when, and why; what ends first comes first."""
    out = Output(output)
    found = list(open_gateway(gateway).pages("/api/v1/silences", "silences"))
    names = ("Silence", "Robots", "Causes", "Up to", "Until (UTC)", "By", "Reason")
    out.listing(names, found, _silence_row, empty="nothing is silenced")


def _silence_row(item: Mapping[str, Any]) -> Sequence[object]:
    robots, causes = " ".join(item["robots"]) or "all", " ".join(item["causes"]) or "all"
    return (item["id"], robots, causes, item["up_to"], stamp(item["until"]), item["by"], item["reason"] or "–")


def _unsilence(
    silence: Annotated[str, typer.Argument(metavar="SILENCE", help="As `metaros alert silences` shows it.")],
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """End a silence now."""
    out = Output(output)
    done = open_gateway(gateway).delete(f"/api/v1/silences/{path_part(silence)}")
    if out.json:
        out.objects(done)
    else:
        out.line(f"{sanitize(silence)}: over")


def _checks(
    changed: Annotated[bool, typer.Option("--changed", help="Only those that are not as they come.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """What is looked for: each check and detector, with its bounds. A star marks what somebody changed."""
    out = Output(output)
    found = [
        item for item in open_gateway(gateway).pages("/api/v1/alert-checks", "checks") if item["changed"] or not changed
    ]
    names = ("Check", "What", "Severity", "Low", "High", "For", "Clear")
    empty = "every check is as it comes" if changed else "no checks"
    out.listing(names, found, _check_row, empty=empty, right=(3, 4, 5, 6))


def _check_row(item: Mapping[str, Any]) -> Sequence[object]:
    def marked(name: str, text: str) -> str:
        return f"{text} *" if name in item["changed"] else text

    unit = f" {item['unit']}" if item["unit"] else ""
    low, high = (number(item[name]) + (unit if item[name] is not None else "") for name in ("low", "high"))
    severity = item["severity"] if item["enabled"] else "off"
    severity = marked("severity" if item["enabled"] else "enabled", severity)
    spans = [marked(name, span(item[name])) for name in ("for_s", "clear_s")]
    return (item["id"], item["title"], severity, marked("low", low), marked("high", high), *spans)


def _check(
    check: CheckId,
    low: Annotated[str, typer.Option("--low", metavar="NUMBER|none", help="What is below fires.")] = "",
    high: Annotated[str, typer.Option("--high", metavar="NUMBER|none", help="What is above fires.")] = "",
    for_: Annotated[str, typer.Option("--for", metavar="SPAN", help="How long, before it fires: 10s, 5m.")] = "",
    clear: Annotated[str, typer.Option("--clear", metavar="SPAN", help="How long not, before it is over.")] = "",
    severity: Annotated[str, typer.Option("--severity", metavar="info|warning|error", help="How bad it is.")] = "",
    on: Annotated[bool | None, typer.Option("--on/--off", help="Look for it, or do not.")] = None,
    reset: Annotated[bool, typer.Option("--reset", help="As it comes out of the box.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Show one check, change it, or put it back, for the whole fleet. It holds at once."""
    out, http = Output(output), open_gateway(gateway)
    given = {
        "for_s": span_s(for_, "--for") if for_ else None,
        "clear_s": span_s(clear, "--clear") if clear else None,
        "severity": severity or None,
        "enabled": on,
    }
    changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    changes |= {name: _bound(text, f"--{name}") for name, text in (("low", low), ("high", high)) if text}
    if changes and reset:
        raise UsageError("say either --reset, or what to change")
    found = _checked(http, check, changes, reset=reset)
    if out.json:
        out.objects(found)
        return
    out.line(out.style(sanitize(found["title"]), "1"))
    for name, text in _check_facts(found):
        star = " *" if name in found["changed"] else ""
        out.line(f"  {out.style(name.removesuffix('_s').ljust(8), '2')}  {sanitize(text)}{star}")
    if found["changed"]:
        out.note(f"* changed by {found['changed_by'] or 'nobody known'}; back: metaros alert check {check} --reset")


def _bound(text: str, flag: str) -> float | None:
    try:
        return None if text == "none" else float(text)
    except ValueError:
        raise UsageError(f"{flag} {text}: not a number, nor none") from None


def _checked(http: GatewayClient, check: str, changes: dict[str, Any], *, reset: bool) -> Any:
    """The check as it is, after the change if there is one."""
    path = f"/api/v1/alert-checks/{path_part(check)}"
    if reset:
        return http.delete(path)
    if changes:
        with http.open("PUT", path, body=changes):
            pass
    found = [item for item in http.pages("/api/v1/alert-checks", "checks") if item["id"] == check]
    if not found:
        raise UsageError(f"there is no check {check}\n`metaros alert checks` lists them")
    return found[0]


def _check_facts(item: Mapping[str, Any]) -> list[tuple[str, str]]:
    unit = f" {item['unit']}" if item["unit"] else ""
    facts = [
        ("check", str(item["id"])),
        ("enabled", "yes" if item["enabled"] else "no"),
        ("severity", item["severity"]),
    ]
    facts += [(name, f"{number(item[name])}{unit}") for name in ("low", "high") if item[name] is not None]
    return [*facts, *((name, span(item[name])) for name in ("for_s", "clear_s"))]


def _learning(
    robot: Robot,
    every: Annotated[bool, typer.Option("--all", "-a", help="Those that are quiet and learned, too.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """What the detectors know of a robot: series they are learning, and those that look unlike themselves now."""
    out = Output(output)
    found = list(open_gateway(gateway).pages(f"/api/v1/robots/{path_part(robot)}/watch", "series"))
    shown = [item for item in found if every or item["seen"] < item["of"] or item["score"] >= THRESHOLD / 2]
    names = ("Series", "State", "Score", "Expected now")
    out.listing(names, shown, _learning_row, empty="", right=(2,))
    if not out.json:
        ready = sum(item["seen"] >= item["of"] for item in found)
        hidden = "" if len(shown) == len(found) else f"; {len(found) - len(shown)} more with --all"
        out.note(f"{ready} of {len(found)} series are learned{hidden}")


def _learning_row(item: Mapping[str, Any]) -> Sequence[object]:
    seen, of = item["seen"], item["of"]
    state = f"{_meter(seen, of)} {seen} of {of}" if seen < of else "learned"
    low, high = item["low"], item["high"]
    expected = "–" if low is None or high is None else f"{number(low)} to {number(high)}"
    return (item["series"], state, f"{item['score']:.2f}", expected if seen >= of else "–")


def _meter(seen: int, of: int) -> str:
    full = METER_CELLS * seen // max(1, of)
    return "━" * full + "╌" * (METER_CELLS - full)


def _routes(gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Who is told of alerts: webhooks and mail, with what became of their notices."""
    out = Output(output)
    found = list(open_gateway(gateway).pages("/api/v1/alert-routes", "routes"))
    names = ("Route", "Kind", "To", "Least", "Sent", "Failed", "Waiting", "Last error")
    empty = "nobody is told: start the gateway with --notify FILE"
    out.listing(names, found, _route_row, empty=empty, right=(4, 5, 6))


def _route_row(item: Mapping[str, Any]) -> Sequence[object]:
    error = item["last_error"] or "–"
    least = item["severity"]
    return (
        *(item["name"], item["kind"], item["target"], least),
        *(item["sent"], item["failed"], item["waiting"]),
        error if len(error) <= 60 else f"{error[:59]}…",
    )


def _test_notice(
    route: Annotated[str, typer.Argument(metavar="ROUTE", help="Its name, as `metaros alert routes` shows it.")],
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Send one notice by a route. Exit code 1 where it is not delivered."""
    out = Output(output)
    done = open_gateway(gateway).post(f"/api/v1/alert-routes/{path_part(route)}/test", {})
    if out.json:
        out.objects(done)
    elif done["ok"]:
        out.line(f"{out.style('✓', '32')} delivered in {done['took_s']:.2f} s")
    if not done["ok"]:
        raise PeerError(f"it was not delivered: {done['error'] or done['status']}")
