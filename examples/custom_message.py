"""A message type of one's own: an annotated class, published and heard. `metaros topic echo /battery` reads it too.

`--count N` ends after N messages.
"""

from __future__ import annotations

import argparse
from dataclasses import field
from enum import IntEnum
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

import metaros
from metaros.interfaces.std_msgs.msg import Header


class Charge(IntEnum):
    """What the charger does; others see the numbers, and the names as constants of the type."""

    OFF = 0
    TRICKLE = 1
    FULL = 2


@metaros.message
class Cell:
    """One cell of the battery."""

    volts: metaros.float32 = 3.7
    celsius: metaros.float32 = 20.0


@metaros.message
class Battery:
    """The ROS type custom_message/msg/Battery, after the file's name."""

    MAX_CELLS: ClassVar[metaros.uint8] = 16

    header: Header
    serial: Annotated[str, metaros.Bounded(20)] = "unknown"
    charge: Annotated[Charge, metaros.Exact("uint8")] = Charge.OFF
    cells: Annotated[list[Cell], metaros.Bounded(16)] = field(default_factory=list)
    heat_map: Annotated[NDArray[np.float32], metaros.Shape(2, 3)]

    def volts(self) -> float:
        """Methods are for Python alone."""
        return sum(cell.volts for cell in self.cells)


def main() -> None:
    """Publish twice a second, and listen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=0, help="how many messages; 0 means for ever")
    count = parser.parse_args().count

    with metaros.Node("battery") as node:
        publisher = node.create_publisher(Battery, "battery")
        heard = 0

        @node.timer(0.5)
        def measure() -> None:
            cells = [Cell(volts=3.5), Cell(volts=4.0)]
            publisher.publish(Battery(serial="A1", charge=Charge.TRICKLE, cells=cells, heat_map=np.full((2, 3), 21.5)))

        @node.subscription(Battery, "battery")
        def show(battery: Battery) -> None:
            nonlocal heard
            heard += 1
            node.get_logger().info(
                f"{battery.serial}: {battery.volts()} V in {len(battery.cells)} cells, {battery.charge.name}, "
                f"hottest {battery.heat_map.max()} of {battery.heat_map.shape}"
            )
            if heard == count:
                node.close()

        metaros.spin(node)


if __name__ == "__main__":
    main()
