"""2AFC: two transitions, and which of them takes longer (Macmillan & Creelman 2005, chapter 7)."""

from __future__ import annotations

from study.tasks.forced import forced_choice
from study.tasks.trial import PLACES

TWO_ALTERNATIVES = forced_choice(
    "2afc",
    decides="which of two transitions takes longer",
    orders=((0, 1), (1, 0)),
    right=lambda trial: PLACES[trial.members.index(int((trial.difference_frames or 0) > 0))],
    alike="where one of two has to be longer",
    did="said which of two transitions took longer",
    welcome="welcome_pairs",
)
