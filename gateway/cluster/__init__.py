"""Several gateways of one store as one: live data and requests cross between them by Zenoh."""
