"""A cluster: several gateways on one store forward live data and requests to each other over Zenoh."""
