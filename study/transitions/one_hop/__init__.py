"""Optimal one-hop motion transitions: Koyama & Goto 2019, exact, in seconds.

`problem` says what is asked, `build.build_table` answers it, `table` keeps the answer, `play` plays it.
"""
