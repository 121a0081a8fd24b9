"""The messages of action_msgs."""

from typing import Final

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.unique_identifier_msgs import msg as unique_identifier_msgs_msg

class GoalInfo(Message):
    goal_id: unique_identifier_msgs_msg.UUID
    stamp: builtin_interfaces_msg.Time
    def __init__(
        self,
        *,
        goal_id: unique_identifier_msgs_msg.UUID = ...,
        stamp: builtin_interfaces_msg.Time = ...,
    ) -> None: ...

class GoalStatus(Message):
    STATUS_UNKNOWN: Final = 0
    STATUS_ACCEPTED: Final = 1
    STATUS_EXECUTING: Final = 2
    STATUS_CANCELING: Final = 3
    STATUS_SUCCEEDED: Final = 4
    STATUS_CANCELED: Final = 5
    STATUS_ABORTED: Final = 6
    goal_info: GoalInfo
    status: int
    def __init__(
        self,
        *,
        goal_info: GoalInfo = ...,
        status: int = ...,
    ) -> None: ...

class GoalStatusArray(Message):
    status_list: list[GoalStatus]
    def __init__(
        self,
        *,
        status_list: list[GoalStatus] = ...,
    ) -> None: ...
