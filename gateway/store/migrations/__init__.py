"""The later migrations, one module each; `gateway.store.schema` puts them in order."""
