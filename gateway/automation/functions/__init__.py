"""Functions: users' handlers, by AWS Lambda's protocols."""
