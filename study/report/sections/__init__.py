"""The sections of the report, one folder a kind of result."""
