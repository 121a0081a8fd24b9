"""What the API shows of the gateway's objects, as JSON."""
