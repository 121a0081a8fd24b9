"""C99 for microcontrollers: structs of ROS 2 messages with their CDR, and the frames of a serial line."""

from __future__ import annotations

from metaros.drivers.serial.c_header.header import render_header

__all__ = ["render_header"]
