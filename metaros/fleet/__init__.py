"""What robots and the gateway share of fleet management: the twin's document, and bundles of software."""
