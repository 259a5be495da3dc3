"""Oddity: three transitions, and which of them differs from the other two (Macmillan & Creelman 2005, chapter 9).

Two slots show the reference, one the comparison, in any of the three places.
"""

from __future__ import annotations

from study.tasks.forced import forced_choice
from study.tasks.trial import PLACES

ODDITY = forced_choice(
    "oddity",
    decides="which of three transitions differs from the other two",
    orders=((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    right=lambda trial: PLACES[trial.members.index(1)],
    alike="where one of three has to differ",
    did="said which of three transitions differed from the other two",
    welcome="welcome_triples",
)
