"""The ids of executed commands: known for ever, as far as anybody can tell, and bounded."""

from __future__ import annotations

import asyncio
import logging
import random  # noqa: TID251 - seeded

import pytest

from edge_agent.commands.executed_ids import CommandLog
from tests.support.simulation.sim_disk import SimDisk


def disk() -> SimDisk:
    return SimDisk(random.Random(1))


def test_the_log_forgets_the_oldest() -> None:
    log = CommandLog(disk(), remembered=2)
    assert [log.first_time(name) for name in (b"a", b"a", b"b", b"c", b"a")] == [True, False, True, True, True]


async def test_ids_outlive_the_process() -> None:
    files = disk()
    log = CommandLog(files)
    for name in (b"a", b"b"):
        assert log.first_time(name)
        await log.keep()
    again = CommandLog(files)
    assert [again.first_time(name) for name in (b"a", b"b", b"c")] == [False, False, True]
    again.wake()
    await again.close()
    assert not CommandLog(files).first_time(b"c")


async def test_those_who_wait_go_on_in_order() -> None:
    log, order = CommandLog(disk()), list[int]()

    async def one(number: int) -> None:
        log.first_time(bytes([number]))
        await log.keep()
        order.append(number)

    await asyncio.gather(*(one(number) for number in range(50)))
    assert order == list(range(50))


async def test_a_torn_last_line_is_written_over_and_a_damaged_one_passed_over() -> None:
    files = disk()
    log = CommandLog(files)
    for name in (b"a", b"b", b"c"):
        log.first_time(name)
        await log.keep()
    damaged = bytearray(files.files["commands.log"][:-3])
    damaged[10] ^= 1
    files.files["commands.log"] = bytes(damaged)
    again = CommandLog(files)
    assert [again.first_time(name) for name in (b"a", b"b", b"c")] == [True, False, True]
    await again.keep()
    assert not any(CommandLog(files).first_time(name) for name in (b"a", b"b", b"c"))


async def test_the_file_is_bounded() -> None:
    files = disk()
    log = CommandLog(files, remembered=10)
    sizes = []
    for number in range(1000):
        log.first_time(number.to_bytes(16, "big"))
        await log.keep()
        sizes.append(files.size("commands.log"))
    assert max(sizes) < 5000
    again = CommandLog(files, remembered=10)
    assert len(again) == 10
    assert not again.first_time((999).to_bytes(16, "big"))


async def test_commands_go_on_while_the_disk_is_full(caplog: pytest.LogCaptureFixture) -> None:
    files = disk()
    log = CommandLog(files)
    files.size_bytes = 0
    with caplog.at_level(logging.WARNING):
        for name in (b"a", b"b"):
            assert log.first_time(name)
            await log.keep()
    assert [record.message for record in caplog.records] == [
        "cannot keep the ids of executed commands: no space left; they are forgotten at a restart"
    ]
    assert not log.first_time(b"a")
    files.size_bytes = 1 << 30
    assert log.first_time(b"c")
    await log.keep()
    assert not any(CommandLog(files).first_time(name) for name in (b"a", b"b", b"c"))


def test_an_id_of_any_length_is_one_id() -> None:
    log = CommandLog(disk())
    assert [log.first_time(name) for name in (b"", b"", bytes(1000), bytes(1000))] == [True, False, True, False]
