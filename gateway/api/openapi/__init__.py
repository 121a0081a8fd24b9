"""The OpenAPI document beyond what FastAPI writes: permissions, examples, and the page that shows it."""
