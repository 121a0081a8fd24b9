"""Alerts: what is told to people of all that the gateway found wrong, from the first finding to the end of it."""
