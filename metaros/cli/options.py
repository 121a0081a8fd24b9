"""Options that many commands share, declared once."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

__all__ = ["DEFAULT_ZENOH_PORT", "Domain", "Format", "FormatOption", "SpinTime", "StatusFile", "ZenohPort"]

DEFAULT_ZENOH_PORT = 7447


class Format(StrEnum):
    """How a command prints."""

    TEXT = "text"
    JSON = "json"


FormatOption = Annotated[
    Format,
    typer.Option(
        "--output", "-o", metavar="text|json", help="For people, or for machines (streams: one JSON object a line)."
    ),
]
ZenohPort = Annotated[
    int,
    typer.Option(
        "--zenoh-port", envvar="METAROS_ZENOH_PORT", min=1, max=65535, metavar="PORT", help="The Zenoh router's."
    ),
]
Domain = Annotated[
    int, typer.Option("--domain", envvar="ROS_DOMAIN_ID", min=0, max=232, metavar="ID", help="ROS domain.")
]
SpinTime = Annotated[
    float,
    typer.Option("--spin-time", min=0.0, max=60.0, metavar="SECONDS", help="How long at most to look for what exists."),
]
StatusFile = Annotated[
    str, typer.Option("--status-file", metavar="FILE", help="Write this JSON file when ready (for supervisors).")
]
