"""AWS Lambda's Runtime API: the engine's side of it, and the worker's."""
