"""A readable recording out of one with sealed topics: an export of a gateway, or a robot's clip."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from metaros.errors import NotSealedError, SealError
from metaros.idl.globs import Glob
from metaros.record.bag import Bag, BagMessage, BagTopic
from metaros.record.rewrite import Rewritten, rewrite
from metaros.seal.envelope import SEALED_CDR, Origin
from metaros.seal.keyring import Keyring
from metaros.seal.opener import Opener, SeenFrames

__all__ = ["Unsealed", "unseal"]


@dataclass(frozen=True, slots=True)
class Unsealed:
    """The new file, how many of its messages were sealed, and how many were refused, by topic and error code."""

    file: Rewritten
    opened: int
    refused: dict[tuple[str, str], int]


def unseal(bag: Bag, output: str | Path, keyring: Keyring, *, robot: str = "", sealed: Sequence[str] = ()) -> Unsealed:
    """Copy a recording with its sealed messages opened; what does not open is left out and counted.

    `robot` is whose recording it is, where the file is not to be believed or does not say. On topics that match one of
    `sealed` nothing is let through that is not. ConfigError and RecordingError as `rewrite`.
    """
    opening = _Opening(Opener(keyring), robot, tuple(Glob(pattern) for pattern in sealed))
    return Unsealed(rewrite(bag, output, change=opening.change), opening.opened, dict(opening.refused))


@dataclass(slots=True)
class _Opening:
    opener: Opener
    robot: str
    must: tuple[Glob, ...] = ()
    seen: SeenFrames = field(default_factory=SeenFrames)
    opened: int = 0
    refused: Counter[tuple[str, str]] = field(default_factory=Counter)
    _topics: dict[BagTopic, tuple[BagTopic, Origin]] = field(default_factory=dict)

    def change(self, message: BagMessage) -> BagMessage | None:
        """The message, readable; None where it is refused."""
        if message.topic.encoding != SEALED_CDR:
            return self._unsealed(message)
        if message.topic not in self._topics:
            self._topics[message.topic] = (replace(message.topic, encoding="cdr"), self._origin(message.topic))
        topic, origin = self._topics[message.topic]
        try:
            opened = self.opener.open(message.data, origin, seq=message.sequence)
            self.seen.note(opened.head, origin)
        except SealError as error:
            self.refused[topic.name, error.code] += 1
            return None
        self.opened += 1
        return message._replace(topic=topic, data=opened.payload)

    def _unsealed(self, message: BagMessage) -> BagMessage | None:
        """A message that nobody sealed, or that somebody says nobody did."""
        names = {message.topic.name, message.topic.origin}
        if any(glob.matches(name) for glob in self.must for name in names):
            self.refused[message.topic.name, NotSealedError.code] += 1
            return None
        return message

    def _origin(self, topic: BagTopic) -> Origin:
        """What the topic's messages must be bound to: its name in the file counts, not what the file says beside it."""
        robot = self.robot or topic.robot
        name = topic.origin if topic.name in (topic.origin, f"/{robot}{topic.origin}") else topic.name
        return Origin(robot=robot, topic=name, type_name=topic.type_name, type_hash=topic.type_hash)
