"""rosbridge v2: what unmodified roslib and roslibpy speak, over one WebSocket a client."""
