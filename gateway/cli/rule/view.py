"""The output of `metaros rule`: rows, and one rule in words."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer
import yaml

from gateway.cli.function.view import moment
from metaros.cli.shared.gateway_http import path_part
from metaros.cli.shared.output import Output, counted, sanitize

__all__ = ["DOCUMENT", "HEADINGS", "RuleName", "does", "rule_path", "rule_row", "show_rule", "waits_for"]

HEADINGS = ("Rule", "State", "When", "Does", "Matched", "Fired", "Last (UTC)")
DOCUMENT = (
    *("name", "description", "enabled", "pattern", "until", "topic", "metric", "schedule", "when"),
    *("event_format", "targets"),
)
WIDE = 60
RuleName = Annotated[str, typer.Argument(metavar="RULE", help="Its name.")]
# The field of each kind of target that says most about it.
TARGETS = {
    "function": "function",
    "webhook": "url",
    "command": "command",
    "publish": "topic",
    "capture": "last_s",
    "alert": "reason",
    "aws": "service",
}


def rule_path(rule: str, end: str = "") -> str:
    """Its place in the API."""
    return f"/api/v1/rules/{path_part(rule)}{end}"


def rule_row(item: Mapping[str, Any]) -> Sequence[object]:
    """A rule as a row under `HEADINGS`."""
    stats = item["stats"]
    state = ("on" if not stats["last_error"] else "on, errors") if item["enabled"] else "off"
    last = moment(stats["last_fired"], seconds=True) if stats["last_fired"] else "–"
    return (
        *(item["name"], state, _cut(waits_for(item)), _cut(", ".join(map(does, item["targets"])) or "counts")),
        *(stats["matched"], stats["fired"], last),
    )


def waits_for(item: Mapping[str, Any]) -> str:
    """What sets a rule off, in words."""
    if item["schedule"]:
        zone = item["schedule"].get("timezone", "UTC")
        return f"{item['schedule']['expression']}{'' if zone == 'UTC' else ' ' + zone}"
    if item["metric"]:
        metric = item["metric"]
        bounds = [f"{name} {metric[name]:g}" for name in ("above", "below") if metric.get(name) is not None]
        text = f"{metric['series']} {' or '.join(bounds)}"
    elif item["topic"]:
        text = f"topic {item['topic']['topic']}"
    else:
        pattern = item["pattern"] or {}
        types = [one for one in pattern.get("detail-type") or () if isinstance(one, str)]
        text = " or ".join(types) or json.dumps(pattern, ensure_ascii=False)
    when = ", ".join(f"{name} {_said(value)}" for name, value in (item["when"] or {}).items())
    return f"{text}; {when}" if when else text


def does(target: Mapping[str, Any]) -> str:
    """`function decide`."""
    said = target.get(TARGETS.get(target["kind"], ""), "")
    return f"{target['kind']} {said}".strip()


def show_rule(out: Output, item: Mapping[str, Any], *, origin: str, only_document: bool) -> None:
    """All of one; its page on the dashboard is at `origin`."""
    document = {name: item[name] for name in DOCUMENT if item[name] not in (None, "")}
    text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=110).rstrip("\n")
    if only_document:
        out.line(text)
        return
    stats = item["stats"]
    mark = out.style("●", "32") if item["enabled"] else out.style("○", "2")
    out.line(f"{mark} {out.style(sanitize(item['name']), '1')}{'' if item['enabled'] else '  off'}")
    if item["description"]:
        out.line(f"  {sanitize(item['description'])}")
    out.line()
    last = f", last {moment(stats['last_fired'], seconds=True)}" if stats["last_fired"] else ""
    facts = [
        ("waits for", waits_for(item)),
        *(("does", does(target)) for target in item["targets"]),
        ("did", f"matched {stats['matched']}, fired {stats['fired']}{last}"),
        ("errors", f"{stats['errors']}, the last: {stats['last_error']}" if stats["last_error"] else ""),
        ("remembers", counted(stats["groups"], "group") if stats["groups"] else ""),
        ("next", moment(item["next_fire"], seconds=True) if item["next_fire"] else ""),
        ("made by", f"{item['maker']['name']} ({item['maker']['role']}), revision {item['revision']}"),
        ("page", f"{origin}/rules/{path_part(item['name'])}"),
    ]
    for name, said in facts:
        if said:
            out.line(f"  {out.style(name.ljust(9), '2')}  {sanitize(said)}")
    out.line()
    for line in text.split("\n"):
        out.line(f"  {sanitize(line)}")


def _said(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _cut(text: str) -> str:
    return text if len(text) <= WIDE else f"{text[: WIDE - 1]}…"
