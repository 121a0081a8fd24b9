"""From a series to a person: detectors, what watches every robot by them, alerts, and checks tried on the past."""
