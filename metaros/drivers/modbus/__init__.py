"""A Modbus device over TCP or a serial line (RTU): the points of a map become topics."""
