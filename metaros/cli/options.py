"""Options that many commands share, declared once."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "DEFAULT_ZENOH_PORT",
    "CredentialsFolder",
    "Domain",
    "Format",
    "FormatOption",
    "ProfileOption",
    "SpinTime",
    "StatusFile",
    "ZenohPort",
    "ZenohProfile",
]

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


class ZenohProfile(StrEnum):
    """How a robot's router guards it."""

    OPEN = "open"
    PROTECTED = "protected"


ProfileOption = Annotated[
    ZenohProfile,
    typer.Option(
        "--zenoh-profile",
        metavar="open|protected",
        help="Protected: users with passwords, and who may drive what moves.",
    ),
]
CredentialsFolder = Annotated[
    Path | None,
    typer.Option(
        "--zenoh-credentials",
        metavar="DIR",
        show_default="~/.metaros/zenoh",
        help="Where the protected profile's passwords and session files are.",
    ),
]
StatusFile = Annotated[
    str, typer.Option("--status-file", metavar="FILE", help="Write this JSON file when ready (for supervisors).")
]
