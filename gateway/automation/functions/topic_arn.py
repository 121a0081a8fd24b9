"""The name of an event source: topics of robots, as `arn:aws:metaros:::topic/ROBOTS/TOPIC`.

ROBOTS and TOPIC are globs (`*` within one step of a name, `**` over several); the topic is without its first slash.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from gateway.automation.functions.errors import FunctionInvalidError

__all__ = ["TopicArn", "parse_topic_arn"]

_ARN = re.compile(r"arn:aws:metaros:[a-z0-9-]*:[0-9]*:topic/([A-Za-z0-9_.*?-]{1,64})/([A-Za-z0-9_/~*?]{1,256})")


@dataclass(frozen=True, slots=True)
class TopicArn:
    """Whose topics, and which; `topic` has its first slash again."""

    robots: str
    topic: str

    def matches(self, robot: str, topic: str) -> bool:
        """Whether a robot's topic is one of the source's."""
        return _glob(self.robots).fullmatch(robot) is not None and _glob(self.topic).fullmatch(topic) is not None


def parse_topic_arn(text: str) -> TopicArn:
    """What an EventSourceArn means; FunctionInvalidError for one that is none of ours."""
    found = _ARN.fullmatch(text)
    if found is None or "//" in found[2] or found[2].endswith("/") or found[2].startswith("/"):
        raise FunctionInvalidError(
            f"EventSourceArn {text[:200]!r}: topics of robots are arn:aws:metaros:::topic/ROBOTS/TOPIC, "
            "such as arn:aws:metaros:::topic/rover-*/battery_state"
        )
    return TopicArn(found[1], f"/{found[2]}")


_GLOBS: dict[str, re.Pattern[str]] = {}


def _glob(text: str) -> re.Pattern[str]:
    found = _GLOBS.get(text)
    if found is None:
        if len(_GLOBS) >= 4096:
            _GLOBS.clear()
        parts = re.split(r"(\*\*|\*|\?)", text)
        words = {"**": ".*", "*": "[^/]*", "?": "[^/]"}
        found = _GLOBS[text] = re.compile("".join(words.get(part, re.escape(part)) for part in parts))
    return found
