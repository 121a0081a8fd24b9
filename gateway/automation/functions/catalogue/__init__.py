"""What functions there are, by AWS Lambda's operations."""
