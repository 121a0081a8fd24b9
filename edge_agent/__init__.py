"""The edge agent: taps a robot's Zenoh graph and forwards chosen topics to a gateway."""
