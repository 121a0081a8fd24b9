"""Resolves the alert of a command: by its id, or as ROBOT/CAUSE, of which there is one at a time."""

from __future__ import annotations

from typing import Annotated

import typer

from metaros.cli.shared.gateway_http import GatewayClient, path_part
from metaros.errors import UsageError

__all__ = ["AlertId", "alert_path"]

AlertId = Annotated[
    str, typer.Argument(metavar="ALERT", help="Its id, as `metaros alert list` shows it, or ROBOT/CAUSE: sim_1/heat.")
]


def alert_path(http: GatewayClient, text: str, rest: str = "") -> str:
    """The path of the alert, or of something of it: of a robot and a cause the newest one."""
    robot, slash, cause = text.partition("/")
    if slash:
        found = http.get("/api/v1/alerts", robot=robot, cause=cause, limit=1)["alerts"]
        if not found:
            raise UsageError(f"{robot} has no alert of {cause}\n`metaros alert list --all` shows what there is")
        text = str(found[0]["id"])
    return f"/api/v1/alerts/{path_part(text)}{rest}"
