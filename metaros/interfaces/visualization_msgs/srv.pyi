"""The services of visualization_msgs."""

from metaros.idl import Message, Service
from metaros.interfaces.service_msgs import msg as service_msgs_msg
from metaros.interfaces.visualization_msgs import msg as visualization_msgs_msg

class GetInteractiveMarkers_Request(Message): ...

class GetInteractiveMarkers_Response(Message):
    sequence_number: int
    markers: list[visualization_msgs_msg.InteractiveMarker]
    def __init__(
        self,
        *,
        sequence_number: int = ...,
        markers: list[visualization_msgs_msg.InteractiveMarker] = ...,
    ) -> None: ...

class GetInteractiveMarkers_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetInteractiveMarkers_Request]
    response: list[GetInteractiveMarkers_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetInteractiveMarkers_Request] = ...,
        response: list[GetInteractiveMarkers_Response] = ...,
    ) -> None: ...

class GetInteractiveMarkers(Service):
    Request = GetInteractiveMarkers_Request
    Response = GetInteractiveMarkers_Response
    Event = GetInteractiveMarkers_Event
