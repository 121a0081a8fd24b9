"""Message classes as rosidl's Python generator makes them, and the modules that know of them."""
