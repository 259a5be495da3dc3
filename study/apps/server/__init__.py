"""Sessions in the browser: an ASGI application that shows what `experiment.session` says comes next.

From the outside in: `running` and `connections` (sockets), `limits`, `inbox` (what pages send, `messages` checked key
by key), `web` with `films` and `researcher` (what is fetched), `hosting` (live sessions, under `settings`), `views`
(what a page may know of a step), `writer` (answers committed in groups). The pages are in `study/apps/pages`.
"""
