"""Camera → edges → JPEG: three nodes that pass images as numpy arrays. Needs the extra `drivers` for the JPEG.

A made-up camera publishes sensor_msgs/Image, a second node finds edges, a third one compresses them for viewers.
`--count N` ends after N pictures.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

import metaros
from metaros import convert
from metaros.clock import SystemClock
from metaros.interfaces.sensor_msgs.msg import CompressedImage, Image

WIDTH, HEIGHT = 320, 240


def scene(number: int) -> NDArray[np.uint8]:
    """A bright square that wanders over a dark picture, as BGR."""
    picture = np.full((HEIGHT, WIDTH, 3), 30, np.uint8)
    left = 10 + 7 * number % (WIDTH - 80)
    picture[80:140, left : left + 60] = (40, 180, 240)
    return picture


def edges(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Where neighbours differ, white on black."""
    signed = grey.astype(np.int16)
    change = np.abs(np.diff(signed, axis=0, prepend=signed[:1])) + np.abs(
        np.diff(signed, axis=1, prepend=signed[:, :1])
    )
    return np.where(change > 40, 255, 0).astype(np.uint8)


def main() -> None:
    """Run the three nodes on one executor."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=0, help="how many pictures; 0 means for ever")
    count = parser.parse_args().count
    camera, finder, packer = (metaros.Node(name) for name in ("camera", "edge_finder", "packer"))
    clock = SystemClock()
    images = camera.create_publisher(Image, "image", metaros.qos_sensor_data)
    found = finder.create_publisher(Image, "edges", metaros.qos_sensor_data)
    packed = packer.create_publisher(CompressedImage, "edges/compressed", metaros.qos_sensor_data)
    taken = done = 0

    @camera.timer(0.1)
    def take() -> None:
        nonlocal taken
        taken += 1
        images.publish(convert.numpy_to_image(scene(taken), "bgr8", stamp_ns=clock.wall_ns(), frame_id="camera"))

    @finder.subscription(Image, "image", qos=metaros.qos_sensor_data)
    def find(image: Image) -> None:
        outline = convert.numpy_to_image(edges(convert.image_to_numpy(image, "mono8")))
        outline.header = image.header
        found.publish(outline)

    @packer.subscription(Image, "edges", qos=metaros.qos_sensor_data)
    def pack(outline: Image) -> None:
        nonlocal done
        picture = convert.numpy_to_compressed(convert.image_to_numpy(outline), quality=70)
        picture.header = outline.header
        packed.publish(picture)
        done += 1
        packer.get_logger().info(f"picture {done}: {outline.data.size} bytes as JPEG are {picture.data.size}")
        if done == count:
            for node in (camera, finder, packer):
                node.close()

    with camera, finder, packer:
        metaros.spin([camera, finder, packer])


if __name__ == "__main__":
    main()
