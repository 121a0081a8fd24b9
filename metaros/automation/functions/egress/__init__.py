"""The way out of a worker: a proxy, and the rules of where it may connect."""
