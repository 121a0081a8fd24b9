"""The messages of stereo_msgs."""

from metaros.idl import Message
from metaros.interfaces.sensor_msgs import msg as sensor_msgs_msg
from metaros.interfaces.std_msgs import msg as std_msgs_msg

class DisparityImage(Message):
    header: std_msgs_msg.Header
    image: sensor_msgs_msg.Image
    f: float
    t: float
    valid_window: sensor_msgs_msg.RegionOfInterest
    min_disparity: float
    max_disparity: float
    delta_d: float
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        image: sensor_msgs_msg.Image = ...,
        f: float = ...,
        t: float = ...,
        valid_window: sensor_msgs_msg.RegionOfInterest = ...,
        min_disparity: float = ...,
        max_disparity: float = ...,
        delta_d: float = ...,
    ) -> None: ...
