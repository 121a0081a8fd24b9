"""The agent's status: status file, report, and the query that answers with it."""
