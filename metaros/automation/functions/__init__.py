"""Users' handlers run under AWS Lambda's Runtime API, in sandboxed workers: the engine that gateway and robot share."""
