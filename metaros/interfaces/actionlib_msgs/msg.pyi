# ruff: noqa: A002
"""The messages of actionlib_msgs."""

from typing import Final

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.std_msgs import msg as std_msgs_msg

class GoalID(Message):
    stamp: builtin_interfaces_msg.Time
    id: str
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        id: str = ...,
    ) -> None: ...

class GoalStatus(Message):
    PENDING: Final = 0
    ACTIVE: Final = 1
    PREEMPTED: Final = 2
    SUCCEEDED: Final = 3
    ABORTED: Final = 4
    REJECTED: Final = 5
    PREEMPTING: Final = 6
    RECALLING: Final = 7
    RECALLED: Final = 8
    LOST: Final = 9
    goal_id: GoalID
    status: int
    text: str
    def __init__(
        self,
        *,
        goal_id: GoalID = ...,
        status: int = ...,
        text: str = ...,
    ) -> None: ...

class GoalStatusArray(Message):
    header: std_msgs_msg.Header
    status_list: list[GoalStatus]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        status_list: list[GoalStatus] = ...,
    ) -> None: ...
