"""Between numpy and messages, one line each way: images, audio, video packets and point clouds.

    publisher.publish(metaros.convert.numpy_to_image(frame, "bgr8"))
    depth = metaros.convert.image_to_numpy(message)
    xyz = metaros.convert.points_xyz(cloud, skip_nan=True)

What a message of a peer says of itself is checked: `DecodeError` names what does not fit. What the caller passes is
checked too: `FieldError`. Arrays of messages are views of their bytes wherever the layout allows it, read-only then.
"""

from __future__ import annotations

from metaros.convert.audio import audio_to_numpy, numpy_to_audio
from metaros.convert.compressed import compressed_to_numpy, numpy_to_compressed
from metaros.convert.image import image_to_numpy, numpy_to_image
from metaros.convert.points import numpy_to_points, points_rgb, points_to_numpy, points_xyz
from metaros.convert.quantized import (
    numpy_to_quantized,
    points_to_quantized,
    quantized_to_numpy,
    quantized_to_points,
)
from metaros.convert.video import foxglove_to_video, is_key_frame, video_packet, video_to_foxglove

__all__ = [
    "audio_to_numpy",
    "compressed_to_numpy",
    "foxglove_to_video",
    "image_to_numpy",
    "is_key_frame",
    "numpy_to_audio",
    "numpy_to_compressed",
    "numpy_to_image",
    "numpy_to_points",
    "numpy_to_quantized",
    "points_rgb",
    "points_to_numpy",
    "points_to_quantized",
    "points_xyz",
    "quantized_to_numpy",
    "quantized_to_points",
    "video_packet",
    "video_to_foxglove",
]
