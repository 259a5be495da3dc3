"""Plans as they were drawn when this test was written: every order, repeats, practice, checks and groups.

A hash that changes here means that a stored seed no longer gives the trials that participants saw.
"""

from __future__ import annotations

import hashlib
import json

import pytest
from toys import TOY_PAIR_RATING, TOY_PROTOCOL, TOY_RATING, pairs_of

from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.tasks.answer import Answer
from study.tasks.registry import answer_columns
from study.tasks.trial import Trial

THIRD = """
[[transitions]]
name = "quick_slow"
category = "walking"
source = "quick"
destination = "slow"

[[transitions]]
name = "slow_still"
category = "standing"
source = "slow"
destination = "still"
"""


def with_keys(study: str, keys: str) -> Protocol:
    """The toy protocol with four transitions; keys of one of its studies are given in place of its own."""
    text = (TOY_PROTOCOL + TOY_RATING + TOY_PAIR_RATING).replace("\n[[studies]]", f"{THIRD}\n[[studies]]", 1)
    head, *studies = text.split("\n[[studies]]\n")
    changed = []
    for part in studies:
        if f'name = "{study}"' in part:
            given = {line.split(" = ")[0] for line in keys.splitlines()}
            kept = [line for line in part.splitlines() if line.split(" = ")[0] not in given]
            lists = next((i for i, line in enumerate(kept) if line.startswith("[[")), len(kept))
            part = "\n".join([*kept[:lists], *keys.splitlines(), *kept[lists:]]) + "\n"
        changed.append(part)
    return parse_protocol("\n[[studies]]\n".join([head, *changed]))


def drawn(trial: Trial) -> list[object]:
    """All that a plan says of a trial."""
    columns = answer_columns(trial, Answer(trial.trial, "", 1, None, None))
    whose = ("trial", "study", "task", "repeat", "pair", "motion", "category", "first", "second")
    meaning = ("difference_frames", "reference_first", "method_a", "method_b", "a_first", "role", "expected")
    return [columns[name] for name in (*whose, *meaning)]


KEYS = {
    "as it stands": ("jnd", ""),
    "both": ("jnd", 'order = "both"\nrepeats = 3\npractice = 4\nattention_checks = 2'),
    "random": (
        "jnd",
        'transitions = ["slow_quick", "slow_still"]\norder = "random"\nrepeats = 2\nattention_checks = 3',
    ),
    "balanced": ("jnd", 'transitions = ["slow_quick", "slow_still"]\norder = "balanced"\nrepeats = 3\npractice = 3'),
    "by group": ("jnd", 'order = "by-group"\nrepeats = 2\npractice = 1'),
    "practice apart": ("jnd", 'order = "both"\npractice = 5\npractice_transitions = ["slow_still"]'),
    "preference": ("liking", 'order = "balanced"\nrepeats = 2\npractice = 3\nattention_checks = 2'),
    "rating at random": ("rating", 'order = "random"\nrepeats = 2\npractice = 2\nattention_checks = 1'),
    "rating by group": ("rating", 'order = "by-group"\nrepeats = 2'),
    "rated pairs": ("compared", 'order = "both"\nrepeats = 2\nattention_checks = 1'),
}


@pytest.mark.parametrize("case", KEYS)
def test_plans_stay_as_they_were_drawn(case: str) -> None:
    protocol = with_keys(*KEYS[case])
    pairs = pairs_of(protocol)
    people = (("p01", None, 0), ("p02", 1, 1), ("Grün", 77, 2), ("p03", 2**62, 5))
    rows = [
        [drawn(trial) for trial in draw_plan(order, pairs, name, seed, group=group).trials]
        for order in (protocol, protocol.model_copy(update={"study_order": "random"}))
        for name, seed, group in people
    ]
    assert hashlib.sha256(json.dumps(rows).encode()).hexdigest()[:16] == HASHES[case]


HASHES = {
    "as it stands": "0607f72b4cc0c5be",
    "both": "f6b2de26617c62ef",
    "random": "4be2b4047a4f0c21",
    "balanced": "4c495d41576037df",
    "by group": "c67c729155526561",
    "practice apart": "c778053bc75d581d",
    "preference": "729fcfad27639973",
    "rating at random": "3682d8372c12251e",
    "rating by group": "4fb43a9311f664f8",
    "rated pairs": "db842161890d0896",
}
