"""The protocol: a TOML file, its parts, its checks and its texts."""
