"""Scenario files: the schema, and a loader whose errors name file, line, key and the way out."""
