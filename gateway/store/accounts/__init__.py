"""Tables of users, keys, sessions, robots' identities and the audit log."""
