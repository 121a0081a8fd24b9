"""The nodes of robot.toml and crash_loop.toml."""
