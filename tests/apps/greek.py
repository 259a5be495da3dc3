"""A study in which every word that a participant can meet is made of Greek letters: any Latin one is Segue's own."""

from __future__ import annotations

import re

from study.experiment.protocol.texts import Consent, Texts


def _word(name: str, default: str) -> str:
    """A text of Greek letters that is as long as its own name, with the slots that it has to have."""
    greek = "".join(chr(0x3B1 + ord(letter) % 24) for letter in name)
    return " ".join([greek, *re.findall(r"\{\w+\}", default)])


def _table(model: type[Texts] | type[Consent]) -> str:
    return "\n".join(f'{name} = "{_word(name, str(field.default))}"' for name, field in model.model_fields.items())


GREEK = f"""\
name = "greek"
title = "Μελέτη"
language = "el"
fps = 30
seed = 3

[stimuli]
width = 160
height = 120
entry_s = 0.3
exit_s = 0.3

[timing]
gap_s = 0.1
pause_s = 0.1
answer_s = 3.0
break_after = 2

[points]
shortest_frames = 4
longest_frames = 20

[keys]
same = "3"
different = "4"

[consent]
{_table(Consent)}

[texts]
{_table(Texts)}

[[form]]
name = "age"
label = "Ηλικία"
kind = "number"
least = 18
required = true

[[form]]
name = "vision"
label = "Όραση"
kind = "choice"
choices = ["καλή", "κακή"]

[[form]]
name = "remark"
label = "Άλλο"

[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "jog"

[[studies]]
name = "jnd"
task = "same-different"
differences_frames = [-2, 0]
practice = 1
attention_checks = 1
question = "Ίδια;"
instructions = "Οδηγίες"

[[studies]]
name = "rating"
task = "rating"
order = "random"
practice = 1
question = "Πώς;"
instructions = "Οδηγίες"

[[studies.items]]
name = "natural"
question = "Φυσική;"
low = "όχι"
high = "ναι"
"""


def latin(text: str) -> list[str]:
    """The Latin letters of a text, word by word."""
    return re.findall(r"[A-Za-zÀ-ɏ]+", text)
