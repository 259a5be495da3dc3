"""A server in a process of its own, to be killed or measured: `python server_child.py FOLDER PORT [DATABASE]`."""

from __future__ import annotations

import sys
from pathlib import Path

from serving import make_host, served_manifest

from study.apps.server.running import listen, serve
from study.apps.server.web import make_app
from study.experiment.store.responses import open_responses

if __name__ == "__main__":
    folder, port = Path(sys.argv[1]), int(sys.argv[2])
    with open_responses(sys.argv[3] if len(sys.argv) > 3 else folder) as responses:
        text = (folder / "protocol.toml").read_text(encoding="utf-8")
        app = make_app(make_host(served_manifest(folder), responses, text))
        serve(app, listen("127.0.0.1", port))
