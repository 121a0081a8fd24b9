"""The gateway as a Foxglove WebSocket server: any robot's topics, services and parameters in an unmodified viewer."""
