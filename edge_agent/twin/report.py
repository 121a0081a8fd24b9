"""The twin's reported state: sent when something changed, rate-limited, and once on every link."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any, Final

from edge_agent.link.handler import SendFrame
from edge_agent.twin.confirm import CommitConfirm
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Reporter", "bounded"]

MESSAGE_CHARS: Final = 1024
LOOK_S: Final = 5.0  # what changes by itself, such as the seconds of a restart, is looked at so often
SHED: Final = ("parameters", "lifecycle", "nodes", "troubles", "agent")  # what is left out first of too long a report


class Reporter:
    """Makes and sends reports. `reported` is what is really so, as a JSON object."""

    def __init__(
        self, confirm: CommitConfirm, reported: Callable[[], dict[str, Any]], clock: Clock, *, limits: Limits = LIMITS
    ) -> None:
        self._confirm = confirm
        self._reported = reported
        self._clock = clock
        self._limits = limits
        self._send_frame: SendFrame | None = None
        self._last: bytes = b""
        self._next_s = -math.inf
        self._look_s = -math.inf
        self._asked = self._stirred = False

    def link(self, send: SendFrame | None) -> None:
        """Another link, or none."""
        self._send_frame, self._last, self._next_s = send, b"", -math.inf
        self._asked = send is not None

    def ask(self) -> None:
        """Send one soon, even where nothing changed."""
        self._asked = True

    def mark_changed(self) -> None:
        """Something may have changed."""
        self._stirred = True

    def wait_s(self) -> float | None:
        """Seconds until `send` may have something to do; None: there is no link."""
        if self._send_frame is None:
            return None
        due_s = self._next_s if self._asked or self._stirred else max(self._next_s, self._look_s)
        return max(0.0, due_s - self._clock.monotonic_s())

    def send(self) -> bool:
        """Send what is due; whether something was."""
        now_s = self._clock.monotonic_s()
        if self._send_frame is None or now_s < self._next_s:
            return False
        if not (self._asked or self._stirred or now_s >= self._look_s):
            return False
        report = self.report()
        data = report.SerializeToString(deterministic=True)
        due = self._asked or data != self._last
        self._asked = self._stirred = False
        self._look_s = now_s + LOOK_S
        if due:
            self._last, self._next_s = data, now_s + self._limits.twin_report_s
            self._send_frame(link_pb2.AgentFrame(twin=report))
        return due

    def report(self) -> link_pb2.TwinReport:
        """How it stands now."""
        confirm = self._confirm
        code, message = confirm.why
        return link_pb2.TwinReport(
            revision=confirm.revision,
            applied=confirm.active_version.revision,
            state=confirm.state,
            code=code,
            message=message[:MESSAGE_CHARS],
            sha256=confirm.active_version.sha256,
            reported=bounded(self._reported(), self._limits.twin_reported_bytes),
        )


def bounded(reported: dict[str, Any], most_bytes: int) -> bytes:
    """As JSON of at most so many bytes; `left_out` names the sections that it is without."""
    told, left_out = dict(reported), []
    for section in (None, *SHED):
        if section is not None and told.pop(section, None) is not None:
            left_out.append(section)
        extra = {"left_out": left_out} if left_out else {}
        data = json.dumps({**told, **extra}, separators=(",", ":"), sort_keys=True, default=str).encode()
        if len(data) <= most_bytes:
            return data
    return json.dumps({"left_out": sorted(reported)[:64]}).encode()
