"""Which topics a recording takes: globs in, globs out. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from metaros.errors import ConfigError
from metaros.idl.globs import Glob

__all__ = ["TopicSelection"]


class TopicSelection:
    """`topics` are names or globs (`**` is everything), `exclude` the exceptions.

    Hidden topics, those with a part that begins with `_`, are taken when asked for by `hidden` or by their full name.
    """

    def __init__(self, topics: Sequence[str], exclude: Sequence[str] = (), *, hidden: bool = False) -> None:
        if not topics:
            raise ConfigError("no topic to record: name some, or take all of them by `**`")
        self._names = frozenset(_absolute(name) for name in topics if "*" not in name)
        self._wanted = [Glob(_absolute(pattern)) for pattern in topics]
        self._unwanted = [Glob(_absolute(pattern)) for pattern in exclude]
        self._hidden = hidden

    def takes(self, topic: str) -> bool:
        """Whether `topic`, a full name, is recorded."""
        if any(glob.matches(topic) for glob in self._unwanted):
            return False
        if topic in self._names:
            return True
        if not self._hidden and "/_" in topic:
            return False
        return any(glob.matches(topic) for glob in self._wanted)


def _absolute(pattern: str) -> str:
    return pattern if pattern.startswith(("/", "**")) else f"/{pattern}"
