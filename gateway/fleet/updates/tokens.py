"""Robots' tokens for the update files: made with each Welcome, good at every gateway of the store for a day.

A token names the robot and when it ends, under an HMAC whose key lies in the store's `meta`. It opens nothing but
signed files, which are no secrets; all the same it ends with the identity that it was made for: a robot that was
revoked is refused, and one that was enrolled again gets another token with its next Welcome.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Callable

from gateway.domain.principal import Principal
from gateway.domain.robot import is_robot_id
from gateway.store import Store
from gateway.store.fleet.updates import fetch_secret
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["PREFIX", "FetchTokens"]

PREFIX = "mrf_"
_SEPARATOR = "~"  # in no robot's id
_CONTEXT = b"metaros update fetch 2|"


class FetchTokens:
    """Makes tokens, and authenticates them."""

    def __init__(self, store: Store, *, clock: Clock, enrolled_ns: Callable[[str], int | None]) -> None:
        """`enrolled_ns`: since when a robot has its identity; 0: it never had one, None: it was revoked."""
        self._store = store
        self._clock = clock
        self._enrolled_ns = enrolled_ns
        self._secret = b""

    async def load(self) -> None:
        """Learn the store's secret, or make it; before the first robot is welcome."""
        fresh = secrets.token_hex(32)
        self._secret = bytes.fromhex(await self._store.run(lambda engine: fetch_secret(engine, fresh)))

    def make(self, robot: str) -> str:
        """A token for that robot; "" before `load`, and for one that was revoked."""
        since_ns = self._enrolled_ns(robot)
        if not self._secret or since_ns is None:
            return ""
        ends_s = self._clock.wall_ns() // 10**9 + round(LIMITS.fetch_token_s)
        return PREFIX + _SEPARATOR.join((robot, str(ends_s), self._mac(robot, ends_s, since_ns)))

    async def by_key(self, text: str) -> Principal | None:
        """The robot of a token that is good; None for everything else."""
        if not self._secret or not text.startswith(PREFIX):
            return None
        robot, _, rest = text.removeprefix(PREFIX).partition(_SEPARATOR)
        said, _, mac = rest.partition(_SEPARATOR)
        if not is_robot_id(robot) or not (said.isascii() and said.isdigit() and len(said) <= 12):
            return None
        since_ns = self._enrolled_ns(robot)
        if since_ns is None or int(said) <= self._clock.wall_ns() // 10**9:
            return None
        good = self._mac(robot, int(said), since_ns)
        if not hmac.compare_digest(mac.encode("utf-8", "surrogatepass"), good.encode()):
            return None
        return Principal(kind="robot", id=robot, name=robot, robots=(robot,))

    async def by_session(self, token: str) -> Principal | None:
        """Robots have none."""
        return None

    def _mac(self, robot: str, ends_s: int, since_ns: int) -> str:
        return hmac.new(self._secret, _CONTEXT + f"{robot}|{ends_s}|{since_ns}".encode(), hashlib.sha256).hexdigest()
