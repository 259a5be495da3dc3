"""The files of a results folder: what each part of a run finds by name."""

MANIFEST, PROTOCOL, STIMULI, ANSWERS = "manifest.json", "protocol.toml", "stimuli", "responses.sqlite"
