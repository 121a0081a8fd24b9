"""`cv_bridge`: images of ROS as arrays for OpenCV, and back."""

from __future__ import annotations

from metaros.ros2.cv_bridge.core import CvBridge, CvBridgeError, cvtColor2, getCvType

__all__ = ["CvBridge", "CvBridgeError", "cvtColor2", "getCvType"]
