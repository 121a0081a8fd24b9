"""One command at a time: sent again, answered by the right one, in progress, given up."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from metaros.clock import ManualClock
from metaros.drivers.mavlink.command_sender import LONGEST_S, CommandSender
from tests.support.waiting import wait_until

US = (255, 190)
COMMAND = dialect.MAV_CMD_COMPONENT_ARM_DISARM


def ack(result: int, *, command: int = COMMAND, to: tuple[int, int] = US) -> Any:
    return dialect.MAVLink_command_ack_message(command, result, 0, 0, *to)


def conversation(
    *answers: list[Any], clock: ManualClock | None = None, answer_s: float = 0.02
) -> tuple[CommandSender, list[Any]]:
    """What the vehicle answers to the first try, the second, …; nothing beyond. And what it was sent."""
    sent: list[Any] = []

    def send(message: Any) -> None:
        sent.append(message)
        for answer in answers[len(sent) - 1] if len(sent) <= len(answers) else []:
            commands.answer(answer, US)

    commands = CommandSender(send, monotonic_s=(clock or ManualClock()).monotonic_s, answer_s=answer_s)
    return commands, sent


def test_a_lost_command_is_sent_again_and_says_so() -> None:
    commands, sent = conversation([], [], [ack(0)])
    assert commands.ask((1, 1), COMMAND, 1.0) == ""
    assert [message.confirmation for message in sent] == [0, 1, 2]
    assert {message.param1 for message in sent} == {1.0}


def test_no_answer_and_answers_to_others_or_to_something_else_are_none() -> None:
    commands, sent = conversation([ack(0, command=1)], [ack(0, to=(254, 190))], [ack(0, to=(255, 1))], [ack(0)])
    assert commands.ask((1, 1), COMMAND) == "no answer to 3 tries"
    assert len(sent) == 3
    assert commands.ask((1, 1), COMMAND) == ""


def test_an_answer_to_everybody_is_ours() -> None:
    commands, _ = conversation([ack(4, to=(0, 0))])
    assert commands.ask((1, 1), COMMAND) == "the vehicle answers: failed"


def running(call: Callable[[], str]) -> tuple[threading.Thread, list[str]]:
    said: list[str] = []
    thread = threading.Thread(target=lambda: said.append(call()))
    thread.start()
    return thread, said


def test_in_progress_is_waited_out_and_another_command_is_refused_meanwhile() -> None:
    commands, sent = conversation([ack(dialect.MAV_RESULT_IN_PROGRESS)])
    thread, said = running(lambda: commands.ask((1, 1), COMMAND))
    wait_until(lambda: sent)
    assert commands.ask((1, 1), COMMAND) == "another command waits for its answer"
    commands.answer(ack(dialect.MAV_RESULT_DENIED), US)
    thread.join(60)
    assert said == ["the vehicle answers: denied"]
    assert len(sent) == 1


def test_in_progress_for_ever_is_reported() -> None:
    clock = ManualClock()
    commands, sent = conversation([ack(dialect.MAV_RESULT_IN_PROGRESS)], clock=clock)
    thread, said = running(lambda: commands.ask((1, 1), COMMAND))
    wait_until(lambda: sent)
    clock.advance(LONGEST_S)
    wait_until(lambda: said or commands.answer(ack(dialect.MAV_RESULT_IN_PROGRESS), US))
    thread.join(60)
    assert said == ["the vehicle answers: in progress"]


def test_a_lost_link_ends_it() -> None:
    commands, sent = conversation(answer_s=60.0)
    thread, said = running(lambda: commands.ask((1, 1), COMMAND))
    wait_until(lambda: sent)
    commands.give_up()
    thread.join(60)
    assert said == ["the link was lost"]
    assert len(sent) == 1
