"""The file of numbers: what a number means outlives crashes, torn lines and full disks."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

import pytest

from edge_agent.config.topic_table import TopicTable
from edge_agent.forwarding.channels import Channels
from edge_agent.outbox import IdLog
from tests.edge_agent.parts import accept, make_outbox
from tests.support.simulation.sim_disk import SimDisk


def disk() -> SimDisk:
    return SimDisk(random.Random(1))


def write(log: IdLog) -> None:
    job = log.job()
    assert job is not None
    job.run()
    log.written(job)


def channel(log: IdLog, topic: str, **more: str) -> int:
    return log.channel(topic=topic, type_name="std_msgs/msg/String", type_hash="RIHS01_00", delivery="bulk", **more)


def test_numbers_survive_and_are_never_given_again() -> None:
    files = disk()
    log = IdLog(files)
    assert [channel(log, "/a"), channel(log, "/b", schema="string data")] == [1, 2]
    assert [log.series_number(name=name, topic="/a", field=name) for name in ("x", "y", "x")] == [1, 2, 1]
    write(log)
    assert log.job() is None
    again = IdLog(files, held={2})
    assert {number: item.topic for number, item in again.channels.items()} == {2: "/b"}
    assert again.channels[2].schema == "string data"
    assert again.series["y"].series == 2
    assert channel(again, "/a") == 3


@pytest.mark.parametrize("cut", range(1, 40))
def test_a_torn_last_line_is_written_over(cut: int) -> None:
    files = disk()
    log = IdLog(files)
    for topic in ("/a", "/b"):
        channel(log, topic)
    write(log)
    files.files["ids.log"] = files.files["ids.log"][:-cut]
    again = IdLog(files, held={1})
    number = channel(again, "/c")
    write(again)
    after = IdLog(files, held={1, number})
    assert (after.channels[1].topic, after.channels[number].topic) == ("/a", "/c")


def test_a_damaged_line_loses_a_name_and_never_a_sample() -> None:
    files = disk()
    outbox = make_outbox(files)
    channels = Channels(TopicTable(), outbox.ids, namespace="/")
    scan = channels.observe("/scan", "std_msgs/msg/String", "RIHS01_00", qos="", keeps_all=True)
    assert scan is not None
    outbox.append(scan.channel_id, "bulk", 1, b"x")
    accept(outbox)
    damaged = bytearray(files.files["ids.log"])
    damaged[20] ^= 1
    files.files["ids.log"] = bytes(damaged)
    (announce,) = Channels(TopicTable(), make_outbox(files, seed=2).ids, namespace="/").announcements(0)
    assert [(item.channel_id, item.topic) for item in announce.channels] == [(1, "/metaros/nameless/stream_1")]


def test_what_nobody_holds_is_forgotten_but_not_its_number() -> None:
    files = disk()
    log = IdLog(files)
    for number in range(400):
        channel(log, f"/t{number}")
    write(log)
    before = files.size("ids.log")
    assert channel(IdLog(files, held={7}), "/new") == 401
    assert files.size("ids.log") < before / 10
    assert channel(IdLog(files, held={7}), "/new") == 401


def test_a_full_disk_does_not_keep_the_file_from_being_read() -> None:
    files = disk()
    log = IdLog(files)
    for number in range(400):
        channel(log, f"/t{number}")
    write(log)
    files.size_bytes = files.used_bytes
    assert channel(IdLog(files), "/new") == 401


def test_a_line_that_could_not_be_written_is_written_with_the_next() -> None:
    files = disk()
    log = IdLog(files)
    channel(log, "/a")
    job = log.job()
    assert job is not None  # it fails: `written` is not called
    channel(log, "/b")
    write(log)
    assert sorted(IdLog(files, held={1, 2}).channels) == [1, 2]


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_damaged_line_of_a_series_keeps_its_number(number: int) -> None:
    """Rows on disk still name it: it must be announced, and must not become another one's."""
    files = disk()
    log = IdLog(files)
    for name in ("x", "y", "z"):
        log.series_number(name=name, topic="/a", field=name)
    write(log)
    lines = files.files["ids.log"].split(b"\n")
    lines[number - 1] = lines[number - 1].replace(b"series", b"seriez")
    files.files["ids.log"] = b"\n".join(lines)
    again = IdLog(files)
    assert {series.series for series in again.series.values()} >= {1, 2, 3}
    assert again.series_number(name="new", topic="/a", field="new") > 3
    write(again)
    assert {series.series for series in IdLog(files).series.values()} >= {1, 2, 3, 4}
