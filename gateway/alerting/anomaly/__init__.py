"""What is unusual in the metrics of a fleet: detectors that learn each series, and checks that know robots."""
