"""One command at a time, with its answer: COMMAND_LONG, sent again until COMMAND_ACK comes (mavlink.io, "Command
Protocol")."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

__all__ = ["ANSWER_S", "TRIES", "CommandSender"]

ANSWER_S: Final = 0.5
TRIES: Final = 3
LONGEST_S: Final = 5.0  # of a command that is in progress


class CommandSender:
    """`ask` is called from the executor's thread, `answer` and `give_up` from the driver's."""

    def __init__(
        self, send: Callable[[Any], None], *, monotonic_s: Callable[[], float], answer_s: float = ANSWER_S
    ) -> None:
        self._send = send
        self._answer_s = answer_s
        self._monotonic_s = monotonic_s
        self._changed = threading.Condition()
        self._asked = 0
        self._result: int | None = None
        self._gone = False

    def ask(self, target: tuple[int, int], command: int, *parameters: float) -> str:
        """Send it; empty when it was accepted, else why not."""
        with self._changed:
            if self._asked:
                return "another command waits for its answer"
            self._asked, self._result, self._gone = command, None, False
        try:
            return self._send_and_wait(target, command, (*parameters, *[0.0] * (7 - len(parameters))))
        finally:
            with self._changed:
                self._asked = 0

    def answer(self, message: Any, us: tuple[int, int]) -> None:
        """A COMMAND_ACK of the target; one to somebody else is not ours."""
        if message.target_system not in (0, us[0]) or message.target_component not in (0, us[1]):
            return
        with self._changed:
            if self._asked and message.command == self._asked:
                self._result = message.result
                self._changed.notify_all()

    def give_up(self) -> None:
        """The link is lost: nobody sends again what was asked before."""
        with self._changed:
            self._gone = True
            self._changed.notify_all()

    def _send_and_wait(self, target: tuple[int, int], command: int, parameters: tuple[float, ...]) -> str:
        for confirmation in range(TRIES):
            with self._changed:
                if self._gone:
                    break
            self._send(dialect.MAVLink_command_long_message(*target, command, confirmation, *parameters))
            with self._changed:
                self._changed.wait_for(lambda: self._gone or self._result is not None, self._answer_s)
                if self._result == dialect.MAV_RESULT_IN_PROGRESS:
                    self._await_end()
                if self._result is not None and not self._gone:
                    return _result_text(self._result)
        return "the link was lost" if self._gone else f"no answer to {TRIES} tries"

    def _await_end(self) -> None:
        until_s = self._monotonic_s() + LONGEST_S
        while not self._gone and self._result == dialect.MAV_RESULT_IN_PROGRESS:
            if (left_s := until_s - self._monotonic_s()) <= 0:
                return
            self._changed.wait(left_s)


def _result_text(result: int) -> str:
    if result == dialect.MAV_RESULT_ACCEPTED:
        return ""
    entry = dialect.enums["MAV_RESULT"].get(result)
    name = entry.name.removeprefix("MAV_RESULT_").replace("_", " ").lower() if entry else f"result {result}"
    return f"the vehicle answers: {name}"
