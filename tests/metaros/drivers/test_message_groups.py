"""Messages put together to rounds."""

from __future__ import annotations

from metaros.drivers.message_groups import MessageGroups


def fed(rounds: MessageGroups, kinds: str, moment: object = None) -> list[str]:
    return ["".join(items) for kind in kinds for items in rounds.feed(kind, 1, moment=moment)]


def test_the_first_round_ends_with_the_next_and_then_each_ends_with_its_last_message() -> None:
    rounds = MessageGroups()
    assert fed(rounds, "abc") == []
    assert fed(rounds, "a") == ["abc"]
    assert fed(rounds, "bc") == ["abc"]
    assert fed(rounds, "abc") == ["abc"]


def test_another_moment_begins_a_round_where_messages_were_lost() -> None:
    rounds = MessageGroups()
    assert fed(rounds, "ab", moment=1) == []
    assert fed(rounds, "b", moment=2) == ["ab", "b"]
    assert fed(rounds, "ab", moment=3) == ["ab"]


def test_silence_ends_a_round_once() -> None:
    rounds = MessageGroups()
    fed(rounds, "ab")
    assert [set(items) for items in rounds.flush()] == [{"a", "b"}]
    assert list(rounds.flush()) == []
    assert fed(rounds, "a") == []


def test_a_device_that_sends_more_than_before_is_followed() -> None:
    rounds = MessageGroups()
    fed(rounds, "abab")
    assert fed(rounds, "abc") == ["ab"]  # c came after what ended the rounds so far
    assert fed(rounds, "abc") == ["abc"]
    assert fed(rounds, "abc") == ["abc"]
