"""Two gateways meet whatever hellos are lost, and both hear when either loses the other."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import pytest

from gateway.cluster.handshake import Handshake
from gateway.cluster.wire import Kind, Message


class Pair:
    """Two meetings, and a line between them that loses what a test says."""

    def __init__(self, losses: tuple[bool, ...] = ()) -> None:
        self.ends = (Handshake(), Handshake())
        self.became: tuple[list[bool], list[bool]] = ([], [])
        self.line: list[tuple[int, Message]] = []
        self.losses = iter(losses)
        self.carried = 0

    def say(self, end: int, done: tuple[list[Message], bool | None]) -> None:
        """An end sends hellos, and may have lost the other."""
        hellos, ended = done
        self.line += [(1 - end, hello) for hello in hellos]
        if ended is not None:
            self.became[end].append(ended)

    def carry(self) -> None:
        """Until nothing is on the line."""
        while self.line:
            self.carried += 1
            assert self.carried < 100, "they greet each other for ever"
            to, hello = self.line.pop(0)
            if next(self.losses, False):
                continue
            hellos, became = self.ends[to].hello(hello)
            self.became[to].extend(became)
            self.line += [(1 - to, answer) for answer in hellos]

    def settle(self) -> None:
        """Some seconds go by."""
        self.carry()
        for _ in range(6):
            for end in (0, 1):
                self.line += [(1 - end, hello) for hello in self.ends[end].retry()]
            self.carry()

    @property
    def met(self) -> bool:
        """Whether what each sends is of now for the other."""
        return all(
            here.met and there.holds(Message(Kind.TELL, here.mine, here.yours))
            for here, there in (self.ends, self.ends[::-1])
        )


def lost(hellos: int) -> Iterator[tuple[bool, ...]]:
    """Every way to lose some of the first hellos."""
    return itertools.product((False, True), repeat=hellos)


def test_they_meet_whatever_is_lost() -> None:
    failures = []
    for losses in lost(7):
        pair = Pair(losses)
        pair.say(0, pair.ends[0].token(True))
        pair.carry()
        pair.say(1, pair.ends[1].token(True))
        pair.settle()
        if not pair.met or pair.became != ([True], [True]):
            failures.append((losses, pair.met, pair.became))
    assert failures == []


@pytest.mark.parametrize(("how", "tokens"), [("missing", 0), ("token of one", 1), ("tokens of both", 2)])
def test_what_one_loses_both_begin_again(how: str, tokens: int) -> None:
    failures = []
    for losses in lost(6):
        pair = Pair()
        for end in (0, 1):
            pair.say(end, pair.ends[end].token(True))
        pair.settle()
        old = Message(Kind.TELL, pair.ends[1].mine, pair.ends[1].yours)
        pair.losses = iter(losses)
        if how == "missing":
            pair.say(0, pair.ends[0].lost())
        for end in range(tokens):
            pair.say(end, pair.ends[end].token(False))
        pair.carry()
        for end in (0, 1):
            pair.say(end, pair.ends[end].token(True))
        pair.settle()
        if not pair.met or pair.became != ([True, False, True], [True, False, True]):
            failures.append((losses, pair.met, pair.became))
        assert not pair.ends[0].holds(old), "what was sent before is of no use any more"
    assert failures == []


def test_nobody_is_met_without_its_token() -> None:
    alone = Handshake()
    assert alone.hello(Message(Kind.HELLO, 1, 1, number=1)) == ([], [])
    assert alone.retry() == []


def test_an_earlier_hello_changes_nothing() -> None:
    pair = Pair()
    for end in (0, 1):
        pair.say(end, pair.ends[end].token(True))
    early = pair.line[0][1]
    pair.settle()
    pair.say(0, pair.ends[0].lost())
    pair.settle()
    assert pair.ends[1].hello(early) == ([], [])
    assert pair.met
