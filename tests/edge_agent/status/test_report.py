"""The report of a state directory: counts what is held, changes nothing, and minds damage and strange files."""

from __future__ import annotations

from pathlib import Path

from edge_agent.outbox import OsDisk
from edge_agent.status.report import held_report
from edge_agent.twin.record import Pending, Record, Version
from edge_agent.twin.state import TwinFile
from metaros.clock import ManualClock
from tests.edge_agent.parts import accept, make_outbox


def listing(directory: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def filled(directory: Path) -> str:
    """An outbox with 3 events, and 5 bulk samples of an outage; its epoch."""
    clock = ManualClock()
    outbox = make_outbox(OsDisk(directory / "outbox"), clock)  # type: ignore[arg-type]
    outbox.online = True
    for number in range(3):
        outbox.append(1, "event", number, b"event")
        accept(outbox)
        clock.advance(10.0)
    outbox.online = False
    for number in range(5):
        outbox.append(2, "bulk", number, b"x" * 1000)
    accept(outbox)
    return f"{outbox.live_epoch:016x}"


def test_what_a_stopped_agent_left_is_counted_and_not_touched(tmp_path: Path) -> None:
    directory = tmp_path / "r1"
    epoch = filled(directory)
    before = listing(directory)
    report = held_report(directory)
    assert listing(directory) == before
    assert (report["name"], report["running"], report["epochs"]) == ("r1", False, [epoch])
    event, metric, bulk = report["classes"]
    assert (event["samples"], event["backfill_bytes"]) == (3, 0)
    assert (bulk["samples"], bulk["fresh_bytes"]) == (5, 0)
    assert bulk["backfill_bytes"] > 5000
    assert bulk["oldest_ns"] - event["oldest_ns"] == 30 * 10**9
    assert (metric["samples"], metric["oldest_ns"]) == (0, None)


def test_an_empty_directory_and_one_of_rubbish(tmp_path: Path) -> None:
    (tmp_path / "outbox" / "bulk").mkdir(parents=True)
    assert [row["samples"] for row in held_report(tmp_path)["classes"]] == [0, 0, 0]
    (tmp_path / "outbox" / "bulk" / "000000000001.seg").write_bytes(b"rubbish")
    (tmp_path / "outbox" / "bulk" / "what.seg").write_bytes(b"")
    (tmp_path / "outbox" / "state.json").write_text("[]")
    (tmp_path / "uplink.json").write_text("{")
    report = held_report(tmp_path)
    assert (report["epochs"], report["budget_bytes_per_s"], report["store_id"]) == ([], None, "")
    assert report["classes"][2]["samples"] == 0


def test_damage_shortens_the_count_at_most(tmp_path: Path) -> None:
    filled(tmp_path)
    segment = next((tmp_path / "outbox" / "event").glob("*.seg"))
    data = bytearray(segment.read_bytes())
    data[-1] ^= 1
    segment.write_bytes(data)
    assert held_report(tmp_path)["classes"][0]["samples"] == 2


def test_how_it_stands_with_the_twin_is_reported(tmp_path: Path) -> None:
    (tmp_path / "outbox").mkdir()
    nothing = {"revision": 0, "applied": 0, "state": "applied", "code": "", "message": ""}
    assert held_report(tmp_path)["twin"] == nothing
    one, two = (Version(revision=number, document=b"{}") for number in (1, 2))
    file = TwinFile(OsDisk(tmp_path))
    file.keep(Record(applied=one, pending=Pending(version=two, until_s=1.0, boot_id="b"), seen=2))
    assert held_report(tmp_path)["twin"] == {**nothing, "revision": 2, "applied": 2, "state": "on trial"}
    file.keep(Record(applied=one, seen=2, undone="reverted", code="not_confirmed", message="late"))
    undone = {"revision": 2, "applied": 1, "state": "reverted", "code": "not_confirmed", "message": "late"}
    assert held_report(tmp_path)["twin"] == undone
