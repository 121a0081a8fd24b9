"""A real Zenoh router in this process: a tenth of what a process of its own costs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh

__all__ = ["inner_router"]


@contextmanager
def inner_router(port: int, *others: int) -> Iterator[zenoh.Session]:
    """On that loopback port, one network with the routers on other ones; closing the session ends it."""
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": "router",
        "listen/endpoints": [f"tcp/127.0.0.1:{port}"],
        "connect/endpoints": [f"tcp/127.0.0.1:{other}" for other in others],
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,  # nobody to wait for
        "timestamping/enabled": True,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    session = zenoh.open(config)
    try:
        yield session
    finally:
        session.close()
