"""Names, globs, exceptions, hidden topics."""

from __future__ import annotations

import pytest

from metaros.errors import ConfigError, NameError_
from metaros.record.selection import TopicSelection


@pytest.mark.parametrize(
    ("topics", "exclude", "hidden", "topic", "taken"),
    [
        (["**"], [], False, "/a/b", True),
        (["**"], ["/a/**"], False, "/a/b", False),
        (["a/*"], [], False, "/a/b", True),
        (["/a/*"], [], False, "/a/b/c", False),
        (["**"], [], False, "/x/_action/feedback", False),
        (["**"], [], True, "/x/_action/feedback", True),
        (["/x/_action/feedback"], [], False, "/x/_action/feedback", True),
        (["odom"], [], False, "/odom", True),
    ],
)
def test_selection(topics: list[str], exclude: list[str], hidden: bool, topic: str, taken: bool) -> None:
    assert TopicSelection(topics, exclude, hidden=hidden).takes(topic) is taken


def test_what_is_no_selection() -> None:
    with pytest.raises(ConfigError, match="no topic"):
        TopicSelection([])
    with pytest.raises(NameError_):
        TopicSelection(["/a b"])
