"""What the agent's parts know of the link to the gateway: frames that they handle, and its budget of bytes."""
