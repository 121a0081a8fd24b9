"""A vehicle that speaks MAVLink: ArduPilot, PX4. Telemetry in ROS messages; commands only where they are allowed."""
