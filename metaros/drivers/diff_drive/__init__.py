"""Differential-drive bases whose motor board speaks the serial protocol of ros_arduino_bridge."""
