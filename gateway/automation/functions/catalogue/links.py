"""Links to code, as AWS's presigned ones: who has one may fetch that zip file for some minutes, and nothing else."""

from __future__ import annotations

import hashlib
import hmac
import re

from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["CodeLinks"]

_TOKEN = re.compile(r"([0-9a-f]{64})-([0-9]{1,12})-([0-9a-f]{64})")
_CONTEXT = b"metaros function code 1|"


class CodeLinks:
    """Makes and reads the tokens; every gateway of a store has the same secret."""

    def __init__(self, *, clock: Clock) -> None:
        self._clock = clock
        self._secret = b""

    def learn(self, secret: str) -> None:
        """The store's secret, hexadecimal."""
        self._secret = bytes.fromhex(secret)

    def make(self, sha256: str) -> str:
        """A token for the zip file with that SHA-256."""
        ends_s = self._clock.wall_ns() // 10**9 + round(LIMITS.lambda_link_s)
        return f"{sha256}-{ends_s}-{self._mac(sha256, ends_s)}"

    def read(self, token: str) -> str | None:
        """The SHA-256 that a token is for; None where it is not good, or not any more."""
        match = _TOKEN.fullmatch(token)
        if match is None or not self._secret:
            return None
        sha256, ends_s = match[1], int(match[2])
        good = hmac.compare_digest(match[3], self._mac(sha256, ends_s))
        return sha256 if good and self._clock.wall_ns() // 10**9 < ends_s else None

    def _mac(self, sha256: str, ends_s: int) -> str:
        return hmac.new(self._secret, _CONTEXT + f"{sha256}|{ends_s}".encode(), hashlib.sha256).hexdigest()
