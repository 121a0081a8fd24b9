"""The composition of the gateway: one module a concern, all called by `gateway.py`."""
