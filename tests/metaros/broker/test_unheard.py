"""What is left out, when it is looked at again, and who gets the messages that nobody saw."""

from __future__ import annotations

from dataclasses import dataclass

from metaros.broker.unheard import Unheard


@dataclass
class _Topic:
    topic: str
    messages: int = 0
    bytes: int = 0
    heard: bool = False

    def has_listeners(self) -> bool:
        return self.heard

    def say(self, messages: int, size_bytes: int) -> None:
        self.messages += messages
        self.bytes += messages * size_bytes


def _unheard(left_out: set[bytes]) -> Unheard:
    return Unheard(ignore=left_out.add, heed=left_out.remove)


def test_only_floods_without_listeners_are_left_out_and_for_a_while() -> None:
    left_out: set[bytes] = set()
    unheard = _unheard(left_out)
    flood, slow, wanted = _Topic("/flood"), _Topic("/slow"), _Topic("/wanted", heard=True)
    for topic, messages in ((flood, 1000), (slow, 10), (wanted, 1000)):
        topic.say(messages, 8)
    unheard.look([flood, slow, wanted], now_s=0.0)
    assert left_out == {b"/flood ", b"flood "}
    unheard.look([flood, slow, wanted], now_s=9.0)
    assert left_out
    unheard.look([flood, slow, wanted], now_s=10.0)
    assert left_out == set()
    flood.say(1000, 8)
    unheard.look([flood, slow, wanted], now_s=10.25)
    assert left_out
    flood.heard = True
    unheard.listen()
    assert left_out == set()


def test_what_nobody_saw_is_counted_exactly_and_shared_by_what_was_seen() -> None:
    unheard = _unheard(set())
    assert not unheard.credit(5, 50), "nothing was left out: it was too fast"
    one, two = _Topic("/one"), _Topic("/two")
    one.say(300, 10)
    unheard.look([one, two], now_s=0.0)
    assert unheard.credit(7, 7 * (10 + 5))
    assert (one.messages, one.bytes) == (307, 3070)
    two.say(900, 20)
    unheard.look([one, two], now_s=0.25)
    assert unheard.credit(401, 401 * 22)
    assert (one.messages - 307, two.messages - 900) == (100, 301)


def test_what_was_under_way_when_a_topic_came_back_is_its_own() -> None:
    unheard = _unheard(set())
    topic = _Topic("/one")
    topic.say(300, 10)
    unheard.look([topic], now_s=0.0)
    topic.heard = True
    unheard.listen()
    assert unheard.credit(3, 45)
    assert unheard.credit(2, 30)
    assert topic.messages == 305
    assert not unheard.credit(1, 15)
