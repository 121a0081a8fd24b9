"""The state of an outbox directory: what survives, and how a copy finds out that it is one."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

import pytest

from edge_agent.outbox.state import OutboxState
from tests.support.simulation.sim_disk import SimDisk


def saved(state: OutboxState) -> SimDisk:
    disk = SimDisk(random.Random(1))
    state.save(disk)
    return disk


def original() -> OutboxState:
    """A process "a" has had a session; then "b" began, when stream 7 stood at 100."""
    state = OutboxState({1: 55}).with_writer("a", {})
    state.sender = "a"
    return state.with_writer("b", {1: {7: 100}})


def test_it_survives_as_it_is() -> None:
    state = original().relabelled(lambda: 77, {1: {7: 10}})
    assert OutboxState.load(saved(state)) == state
    assert (state.epochs, state.bases) == ({1: 77}, {1: {7: 10}})


def test_any_damaged_bit_is_noticed() -> None:
    disk = saved(original())
    data = disk.files["state.json"]
    for at in range(len(data)):
        for bit in range(8):
            disk.files["state.json"] = data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :]
            assert OutboxState.load(disk) in (None, original())  # a letter of the checksum may change its case


@pytest.mark.parametrize(
    ("mark", "sender", "writer", "copied"),
    [
        (100, "a", "a", False),  # what "a" left behind
        (101, "a", "a", True),  # "a" went on after the copy was made
        (130, "b", "b", False),  # "b" sent it
        (130, "a", "b", True),  # "b" has not sent anything yet, whatever the gateway noted at its Hello
        (130, "b", "a", True),  # the gateway never heard of "b"
        (201, "b", "b", True),  # nobody gave this number
    ],
)
def test_what_a_copy_did_not_send(mark: int, sender: str, writer: str, copied: bool) -> None:
    state = original()
    state.sender = sender
    assert state.overtaken({1: {7: 200}}, {(1, 7): mark}, {1: writer}) == (7 if copied else -1)


def test_streams_that_only_the_other_one_has() -> None:
    state = original()
    assert state.overtaken({1: {7: 100}}, {(1, 8): 1}, {1: "a"}) == 8
    assert state.overtaken({1: {7: 100}}, {(1, 8): 0}, {1: "a"}) == -1


def test_writers_are_bounded_and_say_the_same() -> None:
    state = original()
    for number in range(400):
        state = state.with_writer(f"w{number}", {1: {7: 100 + number}})
    assert len(state.writers) <= 256
    assert (state.writers[0], state.writers[-1]) == ("a", "w399")
    assert state.found_after("a") == {1: {7: 100}}
    assert state.found_after("w398") == {1: {7: 499}}
    known = state.known({"w398"}, {1})
    assert len(known.writers) <= 20
    assert known.found_after("w398") == {1: {7: 499}}
