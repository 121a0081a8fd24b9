"""Floods that nobody in ROS listens to: Python does not look at their messages, and yet tells how many there are.

The hub knows the number of all frames, the bridge of those it saw; what is between them are the topics that it has the
hub leave out. Of one such topic the count so is exact. Of several only their sum is, and each gets its share by what it
said before: every topic is looked at again after a while.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, Protocol

__all__ = ["Topic", "Unheard"]

_FLOOD: Final = 250  # messages from one look to the next: fewer cost less than to leave them out
_AGAIN_S: Final = 10.0  # then a topic is looked at again


class Topic(Protocol):
    """What is counted: a route of the bridge."""

    topic: str
    messages: int
    bytes: int

    def has_listeners(self) -> bool:
        """Whether its messages are wanted."""


class Unheard:
    """Which topics are left out. It belongs to the bridge's thread; `ignore` and `heed` tell the hub of a prefix."""

    def __init__(self, *, ignore: Callable[[bytes], None], heed: Callable[[bytes], None]) -> None:
        self._ignore = ignore
        self._heed = heed
        self._until_s: dict[str, float] = {}
        self._topics: dict[str, Topic] = {}  # that what was not seen may be of
        self._shares: dict[str, tuple[int, int]] = {}  # messages and payload bytes of a look
        self._seen: dict[str, tuple[int, int]] = {}  # the counters at the last look
        self._left: set[str] = set()  # that are looked at again, though some of them may still have passed unseen
        self._leaving: set[str] = set()

    def listen(self) -> None:
        """Look again at the topics that somebody listens to by now."""
        for name in [name for name in self._until_s if self._topics[name].has_listeners()]:
            self._release(name)

    def look(self, topics: Iterable[Topic], *, now_s: float) -> None:
        """Leave out what is many and unheard since the last look; call it at regular times."""
        for name in [name for name, until_s in self._until_s.items() if now_s >= until_s]:
            self._release(name)
        for topic in topics:
            if topic.topic in self._until_s:
                continue
            messages, size_bytes = self._seen.get(topic.topic, (0, 0))
            self._seen[topic.topic] = topic.messages, topic.bytes
            if topic.messages - messages >= _FLOOD and not topic.has_listeners():
                self._leave_out(topic, topic.messages - messages, topic.bytes - size_bytes, now_s)

    def credit(self, frames: int, size_bytes: int) -> bool:
        """Count what the hub forwarded and nobody saw; False where no topic was left out."""
        if not self._shares:
            return False
        left, total = frames, sum(messages for messages, _ in self._shares.values())
        weights = {name: payload + messages * (len(name) + 1) for name, (messages, payload) in self._shares.items()}
        for number, (name, (messages, _)) in enumerate(self._shares.items(), 1):
            share = left if number == len(self._shares) else min(left, round(frames * messages / total))
            left -= share
            topic = self._topics[name]
            topic.messages += share
            topic.bytes += max(0, round(size_bytes * weights[name] / sum(weights.values())) - share * (len(name) + 1))
            if name not in self._until_s:
                self._seen[name] = topic.messages, topic.bytes
        for name in self._left:
            del self._shares[name]
            del self._topics[name]
        self._left, self._leaving = self._leaving, set()
        return True

    def _leave_out(self, topic: Topic, messages: int, size_bytes: int, now_s: float) -> None:
        name = topic.topic
        self._until_s[name] = now_s + _AGAIN_S
        self._topics[name] = topic
        self._shares[name] = messages, size_bytes
        self._left.discard(name)
        self._leaving.discard(name)
        for prefix in _spellings(name):
            self._ignore(prefix)

    def _release(self, name: str) -> None:
        del self._until_s[name]
        topic = self._topics[name]
        self._seen[name] = topic.messages, topic.bytes
        self._leaving.add(name)
        for prefix in _spellings(name):
            self._heed(prefix)


def _spellings(topic: str) -> tuple[bytes, bytes]:
    """How messages of one frame begin. Those of two frames cannot be told from ones of a longer name: they are seen."""
    slashed = topic.encode() + b" "
    return slashed, slashed[1:]
