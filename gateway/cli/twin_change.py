"""A change of robots' documents: the options it takes, how it is read and sent, and what is shown of it."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from metaros.cli.shared.gateway_http import GatewayClient
from metaros.cli.shared.output import Output, counted
from metaros.errors import ConfigError
from metaros.fleet.twin import ABSENT, Change, read
from metaros.sanitize import sanitize

__all__ = ["Confirm", "DryRun", "Reason", "read_document", "send", "show_change", "show_changes", "show_lines"]

DryRun = Annotated[bool, typer.Option("--dry-run", help="Only say what would change.")]
Reason = Annotated[str, typer.Option("--reason", metavar="TEXT", help="Why, for the history.")]
Confirm = Annotated[
    float,
    typer.Option(
        "--confirm-s", min=5.0, max=3600.0, metavar="SECONDS", help="Robots go back without a confirmation in it."
    ),
]


def read_document(source: str) -> dict[str, Any]:
    """A document of a file, of standard input, or as it is given; read as strictly as the gateway reads it."""
    if source.lstrip().startswith("{"):
        return read(source)
    if source == "-":
        return read(sys.stdin.buffer.read(1 << 20))
    try:
        return read(Path(source).read_bytes())
    except OSError as error:
        raise ConfigError(f"{source}: {error.strerror}") from None


def send(
    http: GatewayClient,
    method: str,
    path: str,
    body: Mapping[str, Any],
    *,
    query: Mapping[str, Any],
    expected: str = "",
) -> Any:
    """One change, with its options in the query; its answer."""
    import json

    headers = {"If-Match": f'"{expected}"'} if expected else {}
    asked = {key: str(value).lower() if isinstance(value, bool) else value for key, value in query.items()}
    with http.open(method, path, query={k: v for k, v in asked.items() if v != ""}, body=body, headers=headers) as got:
        return json.loads(b"".join(got.pieces()))


def show_change(out: Output, changed: dict[str, Any]) -> None:
    """What a change did, or would do, to one robot."""
    if out.json:
        out.objects(changed)
        return
    show_lines(out, changed["changes"] or changed["own_changes"])
    if changed["more"]:
        out.note(f"and {changed['more']} more")
    would = "would be" if changed["dry_run"] else "is" if changed["changed"] else "stays"
    out.note(f"{changed['robot']} {would} at revision {changed['revision']}")


def show_changes(out: Output, changed: dict[str, Any]) -> None:
    """The same for many."""
    if out.json:
        out.objects(changed)
        return
    for item in changed["results"]:
        if item["changed"]:
            out.line(f"{item['robot']}  revision {item['revision']}")
            show_lines(out, item["changes"] or item["own_changes"], indent="    ")
    would = "would change" if changed["dry_run"] else "changed"
    out.note(f"{would}: {counted(changed['changed'], 'robot')} of {changed['robots']}")


def show_lines(out: Output, changes: list[dict[str, Any]], *, indent: str = "") -> None:
    """Changes, one a line."""
    colours = {"+": "32", "-": "31", "~": "33"}
    for item in changes:
        change = Change(item["path"], item.get("old", ABSENT), item.get("new", ABSENT))
        text = sanitize(change.text)
        out.line(indent + out.style(text, colours[text[0]]))
