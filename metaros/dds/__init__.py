"""Robots on DDS (Fast DDS, Cyclone DDS): their topics and services in the ROS graph on Zenoh, and back."""

from __future__ import annotations

from metaros.dds.bridge import DdsBridge, DdsOptions
from metaros.dds.report import DdsReport, RouteRow

__all__ = ["DdsBridge", "DdsOptions", "DdsReport", "RouteRow"]
