"""The fleet for people and programs over gRPC."""
