"""The Zenoh routers between the gateways: checks their endpoints in the settings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from metaros.errors import ConfigError

__all__ = ["check_routers"]

_ENDPOINT: Final = re.compile(r"(?:tcp|tls|quic|ws)/(?:[A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\]):([0-9]{1,5})(?:[#?].*)?")
MOST: Final = 16


def check_routers(endpoints: Sequence[str]) -> None:
    """ConfigError for what is no endpoint of Zenoh's, naming it."""
    for endpoint in endpoints:
        found = _ENDPOINT.fullmatch(endpoint)
        if found is None or not 0 < int(found[1]) < 65536:
            raise ConfigError(f"--cluster {endpoint[:100]}: a router is named as tcp/host:7447, several with commas")
    if len(endpoints) > MOST:
        raise ConfigError(f"--cluster: {MOST} routers at most, not {len(endpoints)}")
