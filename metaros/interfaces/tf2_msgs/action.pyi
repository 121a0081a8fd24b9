"""The actions of tf2_msgs."""

from metaros.idl import Action, Message, Service
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.geometry_msgs import msg as geometry_msgs_msg
from metaros.interfaces.service_msgs import msg as service_msgs_msg
from metaros.interfaces.tf2_msgs import msg as tf2_msgs_msg
from metaros.interfaces.unique_identifier_msgs import msg as unique_identifier_msgs_msg

class LookupTransform_Goal(Message):
    target_frame: str
    source_frame: str
    source_time: builtin_interfaces_msg.Time
    timeout: builtin_interfaces_msg.Duration
    target_time: builtin_interfaces_msg.Time
    fixed_frame: str
    advanced: bool
    def __init__(
        self,
        *,
        target_frame: str = ...,
        source_frame: str = ...,
        source_time: builtin_interfaces_msg.Time = ...,
        timeout: builtin_interfaces_msg.Duration = ...,
        target_time: builtin_interfaces_msg.Time = ...,
        fixed_frame: str = ...,
        advanced: bool = ...,
    ) -> None: ...

class LookupTransform_Result(Message):
    transform: geometry_msgs_msg.TransformStamped
    error: tf2_msgs_msg.TF2Error
    def __init__(
        self,
        *,
        transform: geometry_msgs_msg.TransformStamped = ...,
        error: tf2_msgs_msg.TF2Error = ...,
    ) -> None: ...

class LookupTransform_Feedback(Message): ...

class LookupTransform_SendGoal_Request(Message):
    goal_id: unique_identifier_msgs_msg.UUID
    goal: LookupTransform_Goal
    def __init__(
        self,
        *,
        goal_id: unique_identifier_msgs_msg.UUID = ...,
        goal: LookupTransform_Goal = ...,
    ) -> None: ...

class LookupTransform_SendGoal_Response(Message):
    accepted: bool
    stamp: builtin_interfaces_msg.Time
    def __init__(
        self,
        *,
        accepted: bool = ...,
        stamp: builtin_interfaces_msg.Time = ...,
    ) -> None: ...

class LookupTransform_SendGoal_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[LookupTransform_SendGoal_Request]
    response: list[LookupTransform_SendGoal_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[LookupTransform_SendGoal_Request] = ...,
        response: list[LookupTransform_SendGoal_Response] = ...,
    ) -> None: ...

class LookupTransform_GetResult_Request(Message):
    goal_id: unique_identifier_msgs_msg.UUID
    def __init__(
        self,
        *,
        goal_id: unique_identifier_msgs_msg.UUID = ...,
    ) -> None: ...

class LookupTransform_GetResult_Response(Message):
    status: int
    result: LookupTransform_Result
    def __init__(
        self,
        *,
        status: int = ...,
        result: LookupTransform_Result = ...,
    ) -> None: ...

class LookupTransform_GetResult_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[LookupTransform_GetResult_Request]
    response: list[LookupTransform_GetResult_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[LookupTransform_GetResult_Request] = ...,
        response: list[LookupTransform_GetResult_Response] = ...,
    ) -> None: ...

class LookupTransform_FeedbackMessage(Message):
    goal_id: unique_identifier_msgs_msg.UUID
    feedback: LookupTransform_Feedback
    def __init__(
        self,
        *,
        goal_id: unique_identifier_msgs_msg.UUID = ...,
        feedback: LookupTransform_Feedback = ...,
    ) -> None: ...

class LookupTransform_SendGoal(Service):
    Request = LookupTransform_SendGoal_Request
    Response = LookupTransform_SendGoal_Response
    Event = LookupTransform_SendGoal_Event

class LookupTransform_GetResult(Service):
    Request = LookupTransform_GetResult_Request
    Response = LookupTransform_GetResult_Response
    Event = LookupTransform_GetResult_Event

class LookupTransform(Action):
    Goal = LookupTransform_Goal
    Result = LookupTransform_Result
    Feedback = LookupTransform_Feedback
