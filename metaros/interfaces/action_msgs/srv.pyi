"""The services of action_msgs."""

from typing import Final

from metaros.idl import Message, Service
from metaros.interfaces.action_msgs import msg as action_msgs_msg
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class CancelGoal_Request(Message):
    goal_info: action_msgs_msg.GoalInfo
    def __init__(
        self,
        *,
        goal_info: action_msgs_msg.GoalInfo = ...,
    ) -> None: ...

class CancelGoal_Response(Message):
    ERROR_NONE: Final = 0
    ERROR_REJECTED: Final = 1
    ERROR_UNKNOWN_GOAL_ID: Final = 2
    ERROR_GOAL_TERMINATED: Final = 3
    return_code: int
    goals_canceling: list[action_msgs_msg.GoalInfo]
    def __init__(
        self,
        *,
        return_code: int = ...,
        goals_canceling: list[action_msgs_msg.GoalInfo] = ...,
    ) -> None: ...

class CancelGoal_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[CancelGoal_Request]
    response: list[CancelGoal_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[CancelGoal_Request] = ...,
        response: list[CancelGoal_Response] = ...,
    ) -> None: ...

class CancelGoal(Service):
    Request = CancelGoal_Request
    Response = CancelGoal_Response
    Event = CancelGoal_Event
