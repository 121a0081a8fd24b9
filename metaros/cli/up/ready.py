"""Waiting until everything answers: status files, the gateway's /readyz, every robot online."""

from __future__ import annotations

import asyncio
import http.client
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from metaros.access.trust import open_connection
from metaros.errors import ConfigError

__all__ = ["get_json", "ready_file", "robots_online", "wait_for"]

POLL_S = 0.05


def ready_file(path: Path) -> bool:
    """True once the process has written its status file and says that it is ready."""
    try:
        return bool(json.loads(path.read_text()).get("ready"))
    except (OSError, ValueError, AttributeError):
        return False


def get_json(url: str, path: str, *, timeout_s: float = 2.0, key: str = "", ca: Path | None = None) -> tuple[int, Any]:
    """GET from the gateway, with an API key where one is given; status 0 where nobody answers who is to be believed.

    Blocks: call it in a thread.
    """
    try:
        connection = open_connection(url, timeout_s=timeout_s, ca=ca)
    except ConfigError:  # no root certificate, or not yet
        return 0, None
    try:
        connection.request("GET", path, headers={"Authorization": f"Bearer {key}"} if key else {})
        response = connection.getresponse()
        return response.status, json.loads(response.read() or b"null")
    except (OSError, ValueError, http.client.HTTPException):
        return 0, None
    finally:
        connection.close()


def robots_online(url: str, *, key: str = "", ca: Path | None = None) -> set[str]:
    """The robots that the gateway says are online."""
    status, body = get_json(url, "/api/v1/robots", key=key, ca=ca)
    if status != 200 or not isinstance(body, dict):
        return set()
    robots: Iterable[dict[str, Any]] = body.get("robots", ())
    return {str(robot["id"]) for robot in robots if robot.get("state") == "online"}


async def wait_for(condition: Callable[[], Any], *, timeout_s: float, every_s: float = POLL_S) -> Any:
    """The first true answer of `condition`, asked in a thread; TimeoutError if there is none in time."""
    async with asyncio.timeout(timeout_s):
        while True:
            if answer := await asyncio.to_thread(condition):
                return answer
            await asyncio.sleep(every_s)
