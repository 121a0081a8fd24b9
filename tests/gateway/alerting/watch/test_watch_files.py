"""Files of the watch: whatever a kill leaves of them, the newest whole snapshot and the logs after it are found."""

from __future__ import annotations

from pathlib import Path

from gateway.alerting.watch.watch_files import WatchFiles


def files(folder: Path, log_bytes: int = 10_000) -> WatchFiles:
    made = WatchFiles(folder, log_bytes=log_bytes)
    made.begin()
    return made


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_first_run_finds_nothing(tmp_path: Path) -> None:
    kept = files(tmp_path / "watch").load()
    assert kept.snapshot is None
    assert list(kept.records()) == []


def test_runs_without_a_snapshot_are_gone_through_from_the_first(tmp_path: Path) -> None:
    for run in range(3):
        made = files(tmp_path)
        made.append(1, b"run %d" % run)
        made.close()
    kept = files(tmp_path).load()
    assert kept.snapshot is None
    assert list(kept.records()) == [(1, b"run 0"), (1, b"run 1"), (1, b"run 2")]


def test_a_snapshot_takes_the_place_of_what_was_before_it(tmp_path: Path) -> None:
    made = files(tmp_path)
    made.append(1, b"before")
    number = made.rotate([(1, b"carried")])
    made.append(2, b"after")
    assert made.save(number, b"state")
    assert names(tmp_path) == ["log-00000002", "snapshot-00000002"]
    made.close()
    kept = files(tmp_path).load()
    assert kept.snapshot == b"state"
    assert list(kept.records()) == [(1, b"carried"), (2, b"after")]


def test_a_kill_before_the_snapshot_is_there_leaves_what_was_before(tmp_path: Path) -> None:
    made = files(tmp_path)
    made.save(made.rotate([]), b"first")
    made.append(1, b"a")
    made.rotate([(1, b"carried")])  # and killed
    (tmp_path / "snapshot-00000003.new").write_bytes(b"half")
    kept = files(tmp_path).load()
    assert kept.snapshot == b"first"
    assert list(kept.records()) == [(1, b"a"), (1, b"carried")]


def test_a_damaged_snapshot_lets_the_watch_begin_anew(tmp_path: Path) -> None:
    made = files(tmp_path)
    made.save(made.rotate([]), b"state")
    path = tmp_path / "snapshot-00000002"
    for damage in (b"", path.read_bytes()[:-1], path.read_bytes()[:-1] + b"X", b"\0" * 100):
        path.write_bytes(damage)
        kept = files(tmp_path).load()
        assert kept.snapshot is None
        assert list(kept.records()) == []


def test_a_full_log_asks_for_a_snapshot_and_stops_at_twice_its_size(tmp_path: Path) -> None:
    made = files(tmp_path, log_bytes=1000)
    while not made.full:
        made.append(1, b"x" * 100)
    assert made.whole
    for _ in range(30):
        made.append(1, b"x" * 100)
    assert not made.whole
    assert made.size_bytes < 2200
    assert made.rotate([])
    assert made.whole
    assert not made.full


def test_a_disk_that_takes_nothing_is_no_error(tmp_path: Path) -> None:
    made = files(tmp_path / "watch")
    for path in (tmp_path / "watch").iterdir():
        path.unlink()
    (tmp_path / "watch").rmdir()
    (tmp_path / "watch").write_bytes(b"")
    assert made.rotate([(1, b"x")]) == 0
    assert not made.whole
    assert not made.save(2, b"state")
    made.append(1, b"y")


def test_a_folder_that_cannot_be_used_leaves_nothing_to_know(tmp_path: Path) -> None:
    (tmp_path / "watch").write_text("no folder")
    kept = WatchFiles(tmp_path / "watch").load()
    assert (kept.snapshot, kept.logs) == (None, ())


def test_what_is_no_readable_snapshot_is_left_out(tmp_path: Path) -> None:
    made = files(tmp_path)
    made.append(1, b"all")
    made.close()
    (tmp_path / "snapshot-00000001").mkdir()
    kept = files(tmp_path).load()
    assert kept.snapshot is None
    assert list(kept.records()) == [(1, b"all")]


def test_snapshots_are_private_and_torn_ones_are_removed(tmp_path: Path) -> None:
    (tmp_path / "snapshot-00000007.new").write_bytes(b"torn")
    made = files(tmp_path)
    assert names(tmp_path) == ["log-00000001"]
    assert made.save(made.rotate([]), b"state")
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o600}
