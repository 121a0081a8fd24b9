"""The services of lifecycle_msgs."""

from metaros.idl import Message, Service
from metaros.interfaces.lifecycle_msgs import msg as lifecycle_msgs_msg
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class ChangeState_Request(Message):
    transition: lifecycle_msgs_msg.Transition
    def __init__(
        self,
        *,
        transition: lifecycle_msgs_msg.Transition = ...,
    ) -> None: ...

class ChangeState_Response(Message):
    success: bool
    def __init__(
        self,
        *,
        success: bool = ...,
    ) -> None: ...

class ChangeState_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[ChangeState_Request]
    response: list[ChangeState_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[ChangeState_Request] = ...,
        response: list[ChangeState_Response] = ...,
    ) -> None: ...

class ChangeState(Service):
    Request = ChangeState_Request
    Response = ChangeState_Response
    Event = ChangeState_Event

class GetAvailableStates_Request(Message): ...

class GetAvailableStates_Response(Message):
    available_states: list[lifecycle_msgs_msg.State]
    def __init__(
        self,
        *,
        available_states: list[lifecycle_msgs_msg.State] = ...,
    ) -> None: ...

class GetAvailableStates_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetAvailableStates_Request]
    response: list[GetAvailableStates_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetAvailableStates_Request] = ...,
        response: list[GetAvailableStates_Response] = ...,
    ) -> None: ...

class GetAvailableStates(Service):
    Request = GetAvailableStates_Request
    Response = GetAvailableStates_Response
    Event = GetAvailableStates_Event

class GetAvailableTransitions_Request(Message): ...

class GetAvailableTransitions_Response(Message):
    available_transitions: list[lifecycle_msgs_msg.TransitionDescription]
    def __init__(
        self,
        *,
        available_transitions: list[lifecycle_msgs_msg.TransitionDescription] = ...,
    ) -> None: ...

class GetAvailableTransitions_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetAvailableTransitions_Request]
    response: list[GetAvailableTransitions_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetAvailableTransitions_Request] = ...,
        response: list[GetAvailableTransitions_Response] = ...,
    ) -> None: ...

class GetAvailableTransitions(Service):
    Request = GetAvailableTransitions_Request
    Response = GetAvailableTransitions_Response
    Event = GetAvailableTransitions_Event

class GetState_Request(Message): ...

class GetState_Response(Message):
    current_state: lifecycle_msgs_msg.State
    def __init__(
        self,
        *,
        current_state: lifecycle_msgs_msg.State = ...,
    ) -> None: ...

class GetState_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetState_Request]
    response: list[GetState_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetState_Request] = ...,
        response: list[GetState_Response] = ...,
    ) -> None: ...

class GetState(Service):
    Request = GetState_Request
    Response = GetState_Response
    Event = GetState_Event
