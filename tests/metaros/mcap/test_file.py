"""Files that PyPI's own reader takes with all checksums, and what a full disk leaves."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from mcap.reader import make_reader

from metaros.errors import ConfigError
from metaros.mcap import COMPRESSIONS, McapFile
from tests.support.nodes.bags import SmallDisk


def fill(file: McapFile[int], count: int, *, size: int = 100) -> int:
    """One channel with `count` messages; the channel's id."""
    channel = file.add_channel("/t", file.add_schema("std_msgs/msg/String", b"string data\n"), {"a": "b"})
    for number in range(count):
        file.write(channel, 1000 + number, 900 + number, number, bytes([number % 251]) * size, number)
    return channel


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_round_trip(compression: str) -> None:
    stream = io.BytesIO()
    file: McapFile[int] = McapFile(stream, compression=compression, chunk_bytes=1000)
    fill(file, 100)
    file.finish(lambda: [("note", {"k": "v"})], lambda _: pytest.fail("nothing is lost"))
    reader = make_reader(io.BytesIO(stream.getvalue()), validate_crcs=True)
    found = [(c.topic, m.log_time, m.publish_time, m.sequence, m.data) for _s, c, m in reader.iter_messages()]
    assert found == [("/t", 1000 + n, 900 + n, n, bytes([n % 251]) * 100) for n in range(100)]
    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 100
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (1000, 1099)
    assert [(record.name, record.metadata) for record in reader.iter_metadata()] == [("note", {"k": "v"})]
    assert len(summary.chunk_indexes) > 5


def test_an_empty_file_is_sound() -> None:
    stream = io.BytesIO()
    file: McapFile[int] = McapFile(stream)
    file.finish(list, lambda _: None)
    reader = make_reader(io.BytesIO(stream.getvalue()), validate_crcs=True)
    assert list(reader.iter_messages()) == []


def test_unknown_compression() -> None:
    with pytest.raises(ConfigError, match="bzip2"):
        McapFile(io.BytesIO(), compression="bzip2")


@pytest.mark.parametrize("room", range(700, 12_000, 331))
def test_a_full_disk_leaves_a_sound_file(room: int, tmp_path: Path) -> None:
    path, lost = tmp_path / "a.mcap", []
    written = 0
    with SmallDisk(path, room) as disk:
        file: McapFile[int] = McapFile(disk, compression="none", chunk_bytes=1000)
        try:
            fill(file, 200)
        except OSError:
            lost += file.abandon_chunk()
        try:
            file.finish(lambda: [("gaps", {"lost": str(len(lost))})], lost.extend)
        except OSError:
            assert file.message_count == 0  # not even an empty recording fits
            return
        written = file.message_count
    reader = make_reader(io.BytesIO(path.read_bytes()), validate_crcs=True)
    found = [message.sequence for _s, _c, message in reader.iter_messages()]
    assert found == list(range(written))
    assert sorted(lost) == list(range(written, written + len(lost)))
    assert path.stat().st_size <= room
    (record,) = reader.iter_metadata()
    assert record.metadata == {"lost": str(len(lost))}
