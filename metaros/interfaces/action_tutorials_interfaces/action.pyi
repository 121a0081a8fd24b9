"""The actions of action_tutorials_interfaces."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Action, Message, Service
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.service_msgs import msg as service_msgs_msg
from metaros.interfaces.unique_identifier_msgs import msg as unique_identifier_msgs_msg

class Fibonacci_Goal(Message):
    order: int
    def __init__(
        self,
        *,
        order: int = ...,
    ) -> None: ...

class Fibonacci_Result(Message):
    sequence: npt.NDArray[np.int32]
    def __init__(
        self,
        *,
        sequence: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class Fibonacci_Feedback(Message):
    partial_sequence: npt.NDArray[np.int32]
    def __init__(
        self,
        *,
        partial_sequence: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class Fibonacci_SendGoal_Request(Message):
    goal_id: unique_identifier_msgs_msg.UUID
    goal: Fibonacci_Goal
    def __init__(
        self,
        *,
        goal_id: unique_identifier_msgs_msg.UUID = ...,
        goal: Fibonacci_Goal = ...,
    ) -> None: ...

class Fibonacci_SendGoal_Response(Message):
    accepted: bool
    stamp: builtin_interfaces_msg.Time
    def __init__(
        self,
        *,
        accepted: bool = ...,
        stamp: builtin_interfaces_msg.Time = ...,
    ) -> None: ...

class Fibonacci_SendGoal_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[Fibonacci_SendGoal_Request]
    response: list[Fibonacci_SendGoal_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[Fibonacci_SendGoal_Request] = ...,
        response: list[Fibonacci_SendGoal_Response] = ...,
    ) -> None: ...

class Fibonacci_GetResult_Request(Message):
    goal_id: unique_identifier_msgs_msg.UUID
    def __init__(
        self,
        *,
        goal_id: unique_identifier_msgs_msg.UUID = ...,
    ) -> None: ...

class Fibonacci_GetResult_Response(Message):
    status: int
    result: Fibonacci_Result
    def __init__(
        self,
        *,
        status: int = ...,
        result: Fibonacci_Result = ...,
    ) -> None: ...

class Fibonacci_GetResult_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[Fibonacci_GetResult_Request]
    response: list[Fibonacci_GetResult_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[Fibonacci_GetResult_Request] = ...,
        response: list[Fibonacci_GetResult_Response] = ...,
    ) -> None: ...

class Fibonacci_FeedbackMessage(Message):
    goal_id: unique_identifier_msgs_msg.UUID
    feedback: Fibonacci_Feedback
    def __init__(
        self,
        *,
        goal_id: unique_identifier_msgs_msg.UUID = ...,
        feedback: Fibonacci_Feedback = ...,
    ) -> None: ...

class Fibonacci_SendGoal(Service):
    Request = Fibonacci_SendGoal_Request
    Response = Fibonacci_SendGoal_Response
    Event = Fibonacci_SendGoal_Event

class Fibonacci_GetResult(Service):
    Request = Fibonacci_GetResult_Request
    Response = Fibonacci_GetResult_Response
    Event = Fibonacci_GetResult_Event

class Fibonacci(Action):
    Goal = Fibonacci_Goal
    Result = Fibonacci_Result
    Feedback = Fibonacci_Feedback
