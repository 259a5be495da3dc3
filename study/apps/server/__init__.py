"""Sessions in the browser: a Starlette application that shows what `experiment.session` says comes next.

`hosting` holds the live sittings, `views` says what a page may know of a step, `messages` checks what comes back,
`writer` commits answers in groups, `web` and `researcher` are the routes. Pages are in `study/apps/pages`.
"""
