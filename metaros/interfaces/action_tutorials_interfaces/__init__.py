"""The interfaces of action_tutorials_interfaces."""
