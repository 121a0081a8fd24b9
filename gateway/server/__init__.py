"""The process and its listeners: HTTP, gRPC and TLS, ports, connection limits, systemd, and graceful shutdown."""
