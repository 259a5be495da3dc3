"""Sessions in the browser: an ASGI application that shows what `experiment.session` says comes next.

From the outside in: `running` and `connections` (sockets), `limits`, `web` with `inbox` (what pages send, `messages`
checked key by key), `films` and `researcher`, `hosting` (the rules of a study, under `settings`), `live` (sessions in
memory), `views` (what a page may know of a step), `writer` (answers committed in groups). The pages are in
`study/apps/pages`.
"""
