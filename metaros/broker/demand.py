"""What ZeroMQ subscribers want now: prefixes of messages, as ZeroMQ has it, and the topics these mean. Pure."""

from __future__ import annotations

from collections.abc import Collection

from metaros.limits import LIMITS

__all__ = ["Demand"]


class Demand:
    """The live subscriptions, and those that went within `linger_s`. Not thread-safe.

    A subscriber of `metaros` 1.x closes its socket after every message and comes back 50 ms later: without the linger
    each message would end and begin a Zenoh subscription. `version` grows with every change.
    """

    def __init__(self, *, linger_s: float = LIMITS.broker_linger_s) -> None:
        self.version = 0
        self.refused = 0  # subscriptions over the limit
        self._linger_s = linger_s
        self._live: set[bytes] = set()
        self._gone: dict[bytes, float] = {}  # until when it lingers

    @property
    def prefixes(self) -> list[bytes]:
        """The live ones, sorted."""
        return sorted(self._live)

    def subscribe(self, prefix: bytes) -> None:
        """Somebody wants messages that begin with `prefix`."""
        if len(self._live) >= LIMITS.broker_prefixes and prefix not in self._live:
            self.refused += 1
            return
        self._live.add(prefix)
        self._gone.pop(prefix, None)
        self.version += 1

    def unsubscribe(self, prefix: bytes, *, now_s: float) -> None:
        """Nobody wants these any more."""
        if prefix in self._live:
            self._live.discard(prefix)
            self._gone[prefix] = now_s + self._linger_s
            self.version += 1

    def sweep(self, *, now_s: float) -> None:
        """Forget what has lingered long enough."""
        over = [prefix for prefix, until in self._gone.items() if now_s >= until]
        for prefix in over:
            del self._gone[prefix]
        self.version += bool(over)

    def spellings(self, topic: str) -> tuple[bytes, ...]:
        """How the topic's name is to be written now: with its slash, without, both, or not at all."""
        return _spellings(topic, self._live)

    def wanted(self, topic: str) -> bool:
        """Whether somebody wants the topic, or did a moment ago."""
        return bool(_spellings(topic, self._live) or _spellings(topic, self._gone))


def _spellings(topic: str, prefixes: Collection[bytes]) -> tuple[bytes, ...]:
    """The empty prefix means everything, once: with the slash."""
    slashed = topic.encode()
    bare = slashed[1:]
    found = [slashed] if any(_meets(prefix, slashed) for prefix in prefixes) else []
    if any(prefix and _meets(prefix, bare) for prefix in prefixes):
        found.append(bare)
    return tuple(found)


def _meets(prefix: bytes, name: bytes) -> bool:
    """Whether a message `name payload` can begin with `prefix`: it may reach into the payload."""
    return name.startswith(prefix) or prefix.startswith(name + b" ")
