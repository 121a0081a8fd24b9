"""What a user has to reach gateways with: their names, keys for them, and who vouches that they are the right ones.

The command line, `metaros.client` and a gateway that tells its own user about itself share these files of the user.
"""
