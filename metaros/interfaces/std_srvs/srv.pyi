"""The services of std_srvs."""

from metaros.idl import Message, Service
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class Empty_Request(Message): ...
class Empty_Response(Message): ...

class Empty_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[Empty_Request]
    response: list[Empty_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[Empty_Request] = ...,
        response: list[Empty_Response] = ...,
    ) -> None: ...

class Empty(Service):
    Request = Empty_Request
    Response = Empty_Response
    Event = Empty_Event

class SetBool_Request(Message):
    data: bool
    def __init__(
        self,
        *,
        data: bool = ...,
    ) -> None: ...

class SetBool_Response(Message):
    success: bool
    message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        message: str = ...,
    ) -> None: ...

class SetBool_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[SetBool_Request]
    response: list[SetBool_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[SetBool_Request] = ...,
        response: list[SetBool_Response] = ...,
    ) -> None: ...

class SetBool(Service):
    Request = SetBool_Request
    Response = SetBool_Response
    Event = SetBool_Event

class Trigger_Request(Message): ...

class Trigger_Response(Message):
    success: bool
    message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        message: str = ...,
    ) -> None: ...

class Trigger_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[Trigger_Request]
    response: list[Trigger_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[Trigger_Request] = ...,
        response: list[Trigger_Response] = ...,
    ) -> None: ...

class Trigger(Service):
    Request = Trigger_Request
    Response = Trigger_Response
    Event = Trigger_Event
