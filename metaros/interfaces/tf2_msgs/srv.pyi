"""The services of tf2_msgs."""

from metaros.idl import Message, Service
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class FrameGraph_Request(Message): ...

class FrameGraph_Response(Message):
    frame_yaml: str
    def __init__(
        self,
        *,
        frame_yaml: str = ...,
    ) -> None: ...

class FrameGraph_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[FrameGraph_Request]
    response: list[FrameGraph_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[FrameGraph_Request] = ...,
        response: list[FrameGraph_Response] = ...,
    ) -> None: ...

class FrameGraph(Service):
    Request = FrameGraph_Request
    Response = FrameGraph_Response
    Event = FrameGraph_Event
