"""Microcontrollers on a serial line: COBS frames with a checksum that carry CDR, the bytes of ROS 2 itself."""
