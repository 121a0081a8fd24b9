"""Authentication and authorization: principals, credentials, permissions, robots' identities, the audit log."""
