"""Robots' nodes: state, logs, parameters, verbs, and failover between robots."""
