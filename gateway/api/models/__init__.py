"""The documents of the API as models: they check bodies and describe answers in OpenAPI."""
