"""The interfaces of example_interfaces."""
