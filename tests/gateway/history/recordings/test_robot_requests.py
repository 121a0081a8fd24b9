"""Asking a robot to cut, where its recording changes before the asking begins."""

from __future__ import annotations

from collections.abc import Coroutine
from dataclasses import replace
from typing import Any

import pytest

from gateway.domain.fleet.recording import FAILED, REQUESTED, STORED, Recording
from gateway.history.recordings.robot_requests import RobotRequests
from metaros._proto import link_pb2
from metaros.clock import ManualClock

ASKED = Recording(id="01J", robot="r1", state=REQUESTED, from_ns=1, to_ns=2, topics=("/a",), requested_ns=0, live_ns=0)


class Rows:
    """One recording's row, that others may change meanwhile."""

    def __init__(self, row: Recording | None) -> None:
        self.row = row

    async def get(self, _recording_id: str) -> Recording | None:
        """As it is now."""
        return self.row

    async def change(self, _recording_id: str, *, within: Any, state: str, **values: Any) -> bool:
        """Only from one of these states."""
        if self.row is None or self.row.state not in within:
            return False
        self.row = replace(self.row, state=state, **values)
        return True


@pytest.mark.parametrize("meanwhile", [None, replace(ASKED, state=STORED), replace(ASKED, state=FAILED)])
async def test_a_recording_that_is_over_or_gone_meanwhile_is_not_asked_for(meanwhile: Recording | None) -> None:
    begun: list[Coroutine[Any, Any, None]] = []
    cut: list[str] = []

    async def command(robot: str, command: link_pb2.Command, *, timeout_s: float) -> link_pb2.CommandResult:
        cut.append(command.save_recording.recording_id)
        return link_pb2.CommandResult(ok=True)

    rows: Any = Rows(meanwhile)
    requests = RobotRequests(rows, command, online=lambda _robot: True, spawn=begun.append, clock=ManualClock())
    requests.ask(ASKED)
    await begun.pop()
    assert (cut, rows.row) == ([], meanwhile)
    rows.row = ASKED  # an asking that ended so is over: the next one begins
    requests.ask(ASKED)
    await begun.pop()
    assert cut == ["01J"]
