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
    "RobotOption",
    "SpinTime",
    "StatusFile",
    "ZenohPort",
    "ZenohProfile",
]

DEFAULT_ZENOH_PORT = 7447


class Format(StrEnum):
    """How a command prints."""

    TEXT = "text"
    TABLE = "table"  # the same, by its other name
    JSON = "json"
    YAML = "yaml"


FormatOption = Annotated[
    Format,
    typer.Option(
        "--output",
        "-o",
        metavar="table|json|yaml",
        help="For people, or for machines (streams: a JSON object a line, YAML documents).",
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


def _robots(incomplete: str) -> list[str]:
    from metaros.cli.shared.completion import robots

    return robots(incomplete)


RobotOption = Annotated[
    str,
    typer.Option(
        "--robot",
        metavar="ROBOT",
        help="Of this robot, anywhere, by its gateway; none: this machine.",
        autocompletion=_robots,
    ),
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
