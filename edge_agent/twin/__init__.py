"""The robot's digital twin: the desired document is stored, applied, confirmed or rolled back, and reported."""
