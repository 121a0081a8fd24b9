"""Names, their rules, and the errors."""
