"""The robots' side of the gateway: links, sessions, and what is known about every robot."""
