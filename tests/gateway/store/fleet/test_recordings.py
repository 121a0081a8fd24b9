"""Recordings' rows on both databases: requests, bounds, changes that happen once, and the way out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from gateway.domain.fleet.recording import (
    CUTTING,
    FAILED,
    REQUESTED,
    STORED,
    TRANSFERRING,
    Recording,
    is_recording_id,
    new_recording_id,
)
from gateway.domain.robot import Robot
from gateway.errors import TooManyError, UnknownRobotError
from gateway.store import ledger
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.fleet.recordings import (
    add_recording,
    change_recording,
    count_unfinished,
    get_recording,
    list_recordings,
    remove_recording,
    unfinished_recordings,
)
from gateway.store.writes import RobotWrite

NOW_NS = 1_700_000_000 * 10**9


def recording(number: int, robot: str = "r1") -> Recording:
    """A request; higher numbers are later."""
    return Recording(
        id=new_recording_id(NOW_NS + number * 10**9),
        robot=robot,
        state=REQUESTED,
        from_ns=-5,
        to_ns=NOW_NS,
        topics=("/a/**", "/ü"),
        requested_ns=NOW_NS,
        live_ns=NOW_NS,
    )


@pytest.fixture
def known(engine: StoreEngine) -> StoreEngine:
    """A store that knows two robots."""
    robots = [RobotWrite(Robot(name, "/", "h", "1", {}), NOW_NS) for name in ("r1", "r2")]
    Committer(engine).commit(robots, now_ns=NOW_NS)
    return engine


def test_a_request_comes_back_as_it_was(known: StoreEngine) -> None:
    asked = recording(1)
    with known.transaction(write=True):
        add_recording(known, asked, unfinished=16)
    with known.transaction(write=False):
        assert get_recording(known, asked.id) == asked
        assert get_recording(known, "nothing") is None


def test_bounds_of_a_robot(known: StoreEngine) -> None:
    with known.transaction(write=True):
        add_recording(known, recording(1), unfinished=2)
        add_recording(known, recording(2), unfinished=2)
        add_recording(known, recording(3, "r2"), unfinished=2)
        with pytest.raises(TooManyError):
            add_recording(known, recording(4), unfinished=2)
        with pytest.raises(UnknownRobotError):
            add_recording(known, recording(5, "nobody"), unfinished=2)
        assert count_unfinished(known, "r1") == 2


def test_lists(known: StoreEngine) -> None:
    asked = [recording(number, "r1" if number % 2 else "r2") for number in range(6)]
    with known.transaction(write=True):
        for item in asked:
            add_recording(known, item, unfinished=16)
        change_recording(known, asked[1].id, state=STORED)
        change_recording(known, asked[2].id, state=FAILED, code="expired")
    with known.transaction(write=False):
        newest = [item.id for item in asked[::-1]]
        assert [item.id for item in list_recordings(known, limit=10)] == newest
        assert [item.id for item in list_recordings(known, limit=2, before=newest[1])] == newest[2:4]
        assert [item.id for item in list_recordings(known, robot_id="r2", limit=9)] == newest[1::2]
        assert [item.id for item in unfinished_recordings(known)] == [asked[n].id for n in (0, 3, 4, 5)]
        assert [item.id for item in unfinished_recordings(known, robots=["r1"])] == [asked[n].id for n in (3, 5)]
        assert unfinished_recordings(known, robots=[]) == []


def test_a_change_happens_only_from_where_it_may(known: StoreEngine) -> None:
    asked = recording(1)
    with known.transaction(write=True):
        add_recording(known, asked, unfinished=16)
        assert change_recording(known, asked.id, within=(REQUESTED,), state=CUTTING)
        assert not change_recording(known, asked.id, within=(REQUESTED,), state=CUTTING)
        assert change_recording(known, asked.id, state=TRANSFERRING, size_bytes=2**40, messages=2**63 - 1)
        assert change_recording(known, asked.id, state=FAILED)
        assert not change_recording(known, asked.id, state=STORED)
        with pytest.raises(ValueError, match="robot"):
            change_recording(known, asked.id, robot=5)
    with known.transaction(write=False):
        expected = replace(asked, state=FAILED, size_bytes=2**40, messages=2**63 - 1)
        assert get_recording(known, asked.id) == expected


def test_removing_names_the_object(known: StoreEngine) -> None:
    asked = recording(1)
    with known.transaction(write=True):
        add_recording(known, asked, unfinished=16)
        ledger.announce(known, "recordings/x.mcap", kind="recording", now_ns=NOW_NS)
        change_recording(known, asked.id, state=STORED, object="recordings/x.mcap")
        removed = remove_recording(known, asked.id)
        assert removed is not None
        assert removed.object == "recordings/x.mcap"
        assert remove_recording(known, asked.id) is None


def test_two_gateways_store_one_recording_once(connect: Callable[[], StoreEngine], known: StoreEngine) -> None:
    asked, other = recording(1), connect()
    with known.transaction(write=True):
        add_recording(known, asked, unfinished=16)
        for name in ("recordings/a.mcap", "recordings/b.mcap"):
            ledger.announce(known, name, kind="recording", now_ns=NOW_NS)
    stored = []
    for engine, name in ((known, "recordings/a.mcap"), (other, "recordings/b.mcap")):
        with engine.transaction(write=True):
            stored.append(change_recording(engine, asked.id, state=STORED, object=name))
    assert stored == [True, False]
    with other.transaction(write=False):
        found = get_recording(other, asked.id)
    assert found is not None
    assert found.object == "recordings/a.mcap"


def test_ids_sort_by_time_and_are_safe_names() -> None:
    ids = [new_recording_id(NOW_NS + number * 10**6) for number in range(100)]
    assert ids == sorted(ids)
    assert all(map(is_recording_id, ids))
    assert len({new_recording_id(NOW_NS) for _ in range(100)}) == 100
    assert not any(map(is_recording_id, ("", "../" + ids[0][3:], ids[0].lower(), ids[0] + "0", ids[0][:-1])))
