"""Joysticks and gamepads of Linux, and driving by them."""
