"""ROS 2 distributions, as far as the wire differs: Humble writes no type hashes, into keys and tokens alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from metaros.errors import ConfigError

__all__ = ["DISTRIBUTIONS", "writes_hashes"]

_ENV: Final = "METAROS_ROS_DISTRO"
DISTRIBUTIONS: Final = ("humble", "jazzy", "kilted", "lyrical", "rolling")  # those that rmw_zenoh has releases for


def writes_hashes(given: str | None, environ: Mapping[str, str]) -> bool:
    """Whether endpoints of that distribution write their types' hashes; `METAROS_ROS_DISTRO` says which, else Jazzy.

    `given` wins. ConfigError for another word.
    """
    chosen, source = (environ.get(_ENV) or "jazzy", _ENV) if given is None else (given, "ros_distro")
    if chosen.lower() not in DISTRIBUTIONS:
        raise ConfigError(f"{source}: {chosen[:40]!r} is none of {', '.join(DISTRIBUTIONS)}")
    return chosen.lower() != "humble"
