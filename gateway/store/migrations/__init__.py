"""The later migrations, one module each; `gateway.store.schema` puts them in order.

A new one is the SQL of both databases in a module here (`{integer}` and the like are their words for a type), and the
next row of the table in `gateway.store.schema`. What has run at somebody's gateway is never changed again.
"""
