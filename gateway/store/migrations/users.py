"""Migration 6: users, their sessions and sign-in links, API keys, and failed sign-ins.

Nothing here is a usable credential: passwords are argon2id hashes, sessions, links and keys are kept as SHA-256
of secrets of 256 bits. Only keys with the scope "lambda" also keep their secret, sealed under the gateway's master
key, which lies in no database.
"""

from __future__ import annotations

__all__ = ["USERS"]

# users.robots, api_keys.robots, api_keys.scopes: JSON lists. users.password: '' where there is none.
# users.external: "<issuer> <subject>" of who signs in elsewhere. api_keys.user_id: null for a key of nobody, made on
# the gateway's own machine. expires_ns: 0 is never. login_failures.who: SHA-256 of the name as typed, as people
# type passwords there, too.
USERS = """
    CREATE TABLE users (
        id TEXT PRIMARY KEY,
        name TEXT NOT NULL UNIQUE,
        role TEXT NOT NULL,
        robots TEXT NOT NULL,
        password TEXT NOT NULL,
        external TEXT UNIQUE,
        disabled {integer} NOT NULL,
        created_ns {integer} NOT NULL,
        signed_in_ns {integer} NOT NULL
    );
    CREATE TABLE sessions (
        id TEXT PRIMARY KEY,
        user_id TEXT NOT NULL REFERENCES users,
        created_ns {integer} NOT NULL,
        seen_ns {integer} NOT NULL,
        expires_ns {integer} NOT NULL,
        address TEXT NOT NULL
    );
    CREATE INDEX sessions_user ON sessions (user_id, created_ns);
    CREATE TABLE sign_in_links (
        id TEXT PRIMARY KEY,
        user_id TEXT NOT NULL REFERENCES users,
        expires_ns {integer} NOT NULL
    );
    CREATE TABLE api_keys (
        id TEXT PRIMARY KEY,
        name TEXT NOT NULL,
        user_id TEXT REFERENCES users,
        role TEXT NOT NULL,
        robots TEXT NOT NULL,
        scopes TEXT NOT NULL,
        secret_hash TEXT NOT NULL,
        sealed {blob},
        created_ns {integer} NOT NULL,
        expires_ns {integer} NOT NULL,
        used_ns {integer} NOT NULL
    );
    CREATE INDEX api_keys_user ON api_keys (user_id);
    CREATE TABLE login_failures (
        who TEXT NOT NULL,
        address TEXT NOT NULL,
        failures {integer} NOT NULL,
        last_ns {integer} NOT NULL,
        until_ns {integer} NOT NULL,
        PRIMARY KEY (who, address)
    ) {rowless};
    CREATE INDEX login_failures_age ON login_failures (last_ns);
"""
