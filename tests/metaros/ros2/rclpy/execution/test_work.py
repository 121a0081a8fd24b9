"""Mail as work: whose it is, in what order it is given back."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.callback_groups import CallbackGroup, ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.inbox import Inbox
from metaros.ros2.rclpy.execution.work import MailWork


def _taken(node: Node, inbox: Inbox) -> MailWork:
    """Its mailbox, as an executor takes it."""
    ingress = node.handle.ingress
    ingress.collect()
    mailbox = inbox._mailbox
    ingress._unclaimed.ready.remove(mailbox)
    return MailWork(mailbox, mailbox.group, node)


def test_a_mailbox_goes_back_once_however_often_that_is_said(node: Node) -> None:
    heard = list[int]()
    for group in (None, ReentrantCallbackGroup()):
        inbox = Inbox(node.handle, heard.append, group)
        for number in range(3):
            inbox.put(number)
        work = _taken(node, inbox)
        work.run(1)
        for _ in range(2):
            work.give_back()
        assert node.handle.ingress._unclaimed.ready.count(inbox._mailbox) == 1
        assert inbox._mailbox.queued
        _taken(node, inbox).run(64)
        inbox.close()
    assert heard == [0, 1, 2, 0, 1]


def test_whose_it_is(node: Node) -> None:
    class Asks(CallbackGroup):
        """Wants to know who."""

    owner: Any = node.create_guard_condition(None)
    for entity, wanted in ((owner, owner), (None, None)):
        inbox = Inbox(node.handle, print, Asks(), entity=entity)
        inbox.put(1)
        work = _taken(node, inbox)
        assert work.entity is work.owner() is (wanted or inbox._mailbox)
        inbox.close()
        work.give_back()
        assert not inbox._mailbox.queued
