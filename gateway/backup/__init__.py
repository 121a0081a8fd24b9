"""A gateway's whole store as files, taken while it works, and a store made of them again."""
