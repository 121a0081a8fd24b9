"""Recordings that wait: over restarts, within bounds, and never one that is not what it says."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from edge_agent.blackbox.clip import Clip
from edge_agent.blackbox.recording_store import RecordingStore, SavedRecording
from edge_agent.errors import DiskError, ManyRecordingsError
from metaros.errors import UsageError
from metaros.limits import Limits


def ident(number: int) -> str:
    return f"01HZZZZZZZZZZZZZZZZZZZZ{number:03d}"


def put(recordings: RecordingStore, number: int, data: bytes = b"clip") -> SavedRecording:
    recordings.draft(ident(number)).write_bytes(data)
    clip = Clip(size_bytes=len(data), sha256=bytes(32), from_ns=1, to_ns=2, messages=3)
    saved = recordings.keep(ident(number), clip, made_ns=number)
    recordings.add(saved)
    return saved


def test_they_survive_a_restart_in_the_order_of_their_making(tmp_path: Path) -> None:
    recordings = RecordingStore(tmp_path)
    made = [put(recordings, number) for number in (3, 1, 2)]
    again = RecordingStore(tmp_path)
    assert list(again) == sorted(made, key=lambda saved: saved.made_ns)
    assert again.read(ident(1), 1, 2) == b"li"
    assert (len(again), again.size_bytes) == (3, 12)
    again.remove(ident(1))
    again.remove(ident(9))
    assert (again.was_here(ident(1)), again.was_here(ident(2)), again.was_here(ident(9))) == (True, False, False)
    assert [saved.recording_id for saved in RecordingStore(tmp_path)] == [ident(2), ident(3)]
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"{ident(n)}.{end}" for n in (2, 3) for end in ("json", "mcap")
    ]


def test_an_interrupted_cut_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / f"{ident(1)}.partial").write_bytes(b"half")
    (tmp_path / f"{ident(2)}.mcap").write_bytes(b"whole, without its name")
    (tmp_path / f"{ident(3)}.json").write_text("{")
    (tmp_path / "notes.txt").write_text("of somebody else")
    assert list(RecordingStore(tmp_path)) == []
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


WRONG: list[dict[str, Any]] = [
    {"size_bytes": "4"},
    {"made_ns": -1},
    {"messages": True},
    {"sha256": "00"},
    {"failed": None},
    {"more": 1},
    {"recording_id": ident(0)},
]


def test_facts_that_are_not_of_their_kind_are_thrown_away(tmp_path: Path) -> None:
    whole = put(RecordingStore(tmp_path), 0)
    facts = json.loads((tmp_path / f"{ident(0)}.json").read_text())
    for number, wrong in enumerate(WRONG, 1):
        (tmp_path / f"{ident(number)}.json").write_text(json.dumps({**facts, "recording_id": ident(number), **wrong}))
        (tmp_path / f"{ident(number)}.mcap").write_bytes(b"clip")
    assert list(RecordingStore(tmp_path)) == [whole]
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{ident(0)}.json", f"{ident(0)}.mcap"]


def test_a_file_that_changed_is_reported_as_failed(tmp_path: Path) -> None:
    recordings = RecordingStore(tmp_path)
    saved = put(recordings, 1, b"0123456789")
    (tmp_path / f"{ident(1)}.mcap").write_bytes(b"01234")
    with pytest.raises(DiskError):
        recordings.read(ident(1), 0, 10)
    for again in (RecordingStore(tmp_path), RecordingStore(tmp_path)):
        assert list(again) == [replace(saved, size_bytes=0, sha256="", failed="damaged")]
    again.remove(ident(1))
    assert list(tmp_path.iterdir()) == []


def test_there_is_room_for_so_many_and_so_much(tmp_path: Path) -> None:
    recordings = RecordingStore(tmp_path, limits=Limits(recordings=2, recordings_bytes=100))
    put(recordings, 1, bytes(60))
    recordings.check(ident(2), size_bytes=40)
    with pytest.raises(ManyRecordingsError):
        recordings.check(ident(2), size_bytes=41)
    put(recordings, 2, b"")
    with pytest.raises(ManyRecordingsError):
        recordings.check(ident(3))


@pytest.mark.parametrize("wrong", ["", "../../etc/passwd", "01HZZZZZZZZZZZZZZZZZZZZ00I", "a" * 26, ident(1) + "\n"])
def test_only_ulids_become_names_of_files(tmp_path: Path, wrong: str) -> None:
    with pytest.raises(UsageError):
        RecordingStore(tmp_path).check(wrong)
