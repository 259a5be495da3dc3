"""Several writers at once, and writers that are killed: nothing acknowledged is lost, nothing is counted twice."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading

import pytest

from study.experiment.responses import answers_frame, open_responses

WRITER = """
import itertools, sys
sys.path.insert(0, "tests/experiment")
import toys as c
from study.experiment.plan import draw_plan
from study.experiment.protocol import parse_protocol
from study.experiment.responses import begin_session, open_responses, record_answer, stored_answers
from study.experiment.session import Answer
protocol = parse_protocol(c.TOY_PROTOCOL)
pairs = c.pairs_of(protocol)
responses = open_responses(sys.argv[1])
for number in itertools.count(int(sys.argv[2])):
    record = begin_session(responses, protocol, draw_plan(protocol, pairs, f"p{number:05d}"))
    there = {answer.trial for answer in stored_answers(responses, record.id)}
    for trial in sorted(set(range(1, 9)) - there):
        assert record_answer(responses, record, Answer(trial, "", 1, "same", 1.0))
        print(number, trial, flush=True)
"""


@pytest.mark.parametrize("kills", [3, pytest.param(200, marks=pytest.mark.slow)])
def test_every_acknowledged_answer_survives_kills(database, repository, kills):
    """The writer is killed at a random moment and taken up again where it stopped."""
    dice = random.Random(7)
    acknowledged: list[tuple[str, int]] = []
    for _ in range(kills):
        begin = acknowledged[-1][0][1:] if acknowledged else "0"
        child = subprocess.Popen(
            [sys.executable, "-c", WRITER, database, begin], cwd=repository, stdout=subprocess.PIPE, text=True
        )
        lines = [child.stdout.readline()]
        killer = threading.Timer(dice.uniform(0.0, 0.3), os.kill, (child.pid, signal.SIGKILL))
        killer.start()
        lines += list(child.stdout)
        child.stdout.close()
        assert child.wait() == -signal.SIGKILL
        whole = [line.split() for line in lines if line.endswith("\n")]
        assert whole, "the writer ended before its first answer"
        acknowledged += [(f"p{int(number):05d}", int(trial)) for number, trial in whole]
    with open_responses(database) as responses:
        table = answers_frame(responses)
    stored = list(zip(table["participant"], table["trial"], strict=True))
    print(f"{kills} kills, {len(acknowledged)} acknowledged answers, {len(stored)} stored")
    assert len(set(stored)) == len(stored)
    assert set(acknowledged) <= set(stored)
    # At most the one answer that was under way at each kill was stored without its word of it arriving.
    assert len(stored) <= len(acknowledged) + kills
