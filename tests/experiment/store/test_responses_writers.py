"""Several writers at once, and writers that are killed: nothing acknowledged is lost, nothing is counted twice."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from toys import FakeStimuli, keep_answer

from study.errors import SessionError
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol
from study.experiment.store import participants as people
from study.experiment.store import tables as response_tables
from study.experiment.store.answers import stored_answers
from study.experiment.store.databases import alone, patiently
from study.experiment.store.frames import answers_frame
from study.experiment.store.migrations import FIRST_VERSION, MIGRATIONS, VERSION
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import begin_session
from study.tasks.answer import Answer
from study.tasks.trial import Trial

WRITER = """
import itertools, sys
sys.path.insert(0, "tests/experiment")
import toys as c
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import parse_protocol
from study.experiment.store.answers import stored_answers
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import begin_session
from study.tasks.answer import Answer
protocol = parse_protocol(c.TOY_PROTOCOL)
pairs = c.pairs_of(protocol)
responses = open_responses(sys.argv[1])
for number in itertools.count(int(sys.argv[2])):
    record = begin_session(responses, protocol, draw_plan(protocol, pairs, f"p{number:05d}"))
    there = {answer.trial for answer in stored_answers(responses, record.id)}
    for trial in sorted(set(range(1, 9)) - there):
        assert c.keep_answer(responses, record, Answer(trial, "", 1, "same", 1.0))
        print(number, trial, flush=True)
"""


@pytest.mark.parametrize("kills", [3, pytest.param(200, marks=pytest.mark.slow)])
def test_every_acknowledged_answer_survives_kills(database: str, repository: Path, kills: int) -> None:
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


PROGRAMS, NEWCOMERS, GROUPS, CAP = 3, 9, 4, 22

ARRIVALS = """
import sys
sys.path.insert(0, "tests/experiment")
import toys as c
from study.experiment.store import participants as people
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import parse_protocol
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import session_by_id
from study.tasks.answer import Answer
database, program, newcomers, groups, cap = sys.argv[1], *map(int, sys.argv[2:])
protocol = parse_protocol(c.TOY_PROTOCOL)
pairs = c.pairs_of(protocol)
sys.stdin.readline()  # until all programs stand here
responses = open_responses(database)
for number in range(newcomers):
    # The first name of each program is the same one.
    name = f"p{program}-{number}" if number else "everybody"
    draw = lambda group: draw_plan(protocol, pairs, name, group=group)
    newcomer = people.Newcomer(name, f"token {program} {number}")
    found = people.admit(responses, protocol, newcomer, people.Places(groups, cap), draw)
    if not isinstance(found, str):
        record = session_by_id(responses, found.session_id)
        for trial in (1, 2):
            assert c.keep_answer(responses, record, Answer(trial, "", 1, "same", 1.0))
        found = "admitted"
    print(name, found, flush=True)
"""


def test_several_programs_fill_groups_evenly_and_keep_the_cap(database: str, repository: Path) -> None:
    """They open an empty database, and admit and record as fast as they can, all at one time."""
    children = []
    for program in range(PROGRAMS):
        arguments = [database, *map(str, (program, NEWCOMERS, GROUPS, CAP))]
        children.append(
            subprocess.Popen(
                [sys.executable, "-c", ARRIVALS, *arguments], cwd=repository, text=True, stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
        )  # fmt: skip
    for child in children:
        child.stdin.write("now\n")
        child.stdin.flush()
    told = [line.split() for child in children for line in child.communicate()[0].splitlines()]
    assert [child.returncode for child in children] == [0] * PROGRAMS
    assert Counter(found for name, found in told if name == "everybody") == {"admitted": 1, "taken": PROGRAMS - 1}
    assert Counter(found for _, found in told)["admitted"] == CAP
    with open_responses(database) as responses:
        filled = people.filled_groups(responses, people.Places(GROUPS))
        table = answers_frame(responses)
        with responses.engine.connect() as connection:
            versions = connection.execute(sa.select(response_tables.schema_version.c.version)).scalars().all()
            ids = connection.execute(sa.select(response_tables.sessions.c.id)).scalars().all()
    assert sum(filled) == CAP
    assert max(filled) - min(filled) <= 1
    assert Counter(table["participant"]) == dict.fromkeys((name for name, found in told if found == "admitted"), 2)
    assert sorted(versions) == list(range(FIRST_VERSION, VERSION + 1))
    assert sorted(ids) == list(range(1, CAP + 1))


@pytest.fixture
def two(database: str) -> Iterator[Any]:
    """Two programs' connections to one database."""
    with open_responses(database) as one, open_responses(database) as other:
        yield one, other


@pytest.fixture
def plan(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> Plan:
    return draw_plan(toy_protocol, toy_stimuli.pairs, "p01")


def test_two_connections_that_record_the_same_answer_record_it_once(
    two: Any, toy_protocol: Protocol, plan: Plan
) -> None:
    record = begin_session(two[0], toy_protocol, plan)
    with ThreadPoolExecutor(2) as threads:
        for trial in range(1, 9):
            together = threading.Barrier(2)

            def send(responses: Responses, trial: Trial = trial, together: Any = together) -> Any:
                together.wait()
                return keep_answer(responses, record, Answer(trial, "", 1, "same", 1.0))

            assert sorted(threads.map(send, two)) == [False, True]
    assert len(stored_answers(two[0], record.id)) == 8


def test_of_two_different_answers_to_one_question_the_first_stands(
    two: Any, toy_protocol: Protocol, plan: Plan
) -> None:
    record = begin_session(two[0], toy_protocol, plan)
    values = ("same", "different")
    with ThreadPoolExecutor(2) as threads:
        for trial in range(1, 9):
            together = threading.Barrier(2)

            def send(number: int, trial: Trial = trial, together: Any = together) -> Any:
                together.wait()
                try:
                    return keep_answer(two[number], record, Answer(trial, "", 1, values[number], 1.0))
                except SessionError as refusal:
                    return str(refusal)

            outcome = list(threads.map(send, (0, 1)))
            assert outcome.count(True) == 1
            assert any("found that one is stored already" in str(told) for told in outcome)
            assert stored_answers(two[0], record.id)[-1].value == values[outcome.index(True)]


def test_what_reads_before_it_writes_runs_alone(two: Any) -> None:
    """The second one begins when the first one has ended, and sees what it did."""
    count = sa.select(sa.func.count()).select_from(response_tables.withdrawals)
    line = sa.insert(response_tables.withdrawals)

    def add(responses: Responses) -> Any:
        with alone(responses.engine) as connection:
            before = connection.execute(count).scalar_one()
            row = {"session_id": before, "answers": 0, "at": datetime.now(UTC)}
            connection.execute(line, row)
        return before

    with ThreadPoolExecutor(8) as threads:
        assert sorted(threads.map(add, two * 10)) == list(range(20))


def test_a_session_that_is_answered_while_it_is_erased_twice_is_gone_whole(
    two: Any, toy_protocol: Protocol, plan: Plan
) -> None:
    for number in range(8):
        record = begin_session(two[0], toy_protocol, replace(plan, participant=f"p{number}"))
        together = threading.Barrier(3)

        def answer_all(record: Any = record, together: Any = together) -> str:
            together.wait()
            for trial in range(1, 9):
                try:
                    keep_answer(two[0], record, Answer(trial, "", 1, "same", 1.0))
                except SessionError as gone:
                    return str(gone)
            return ""

        def erase(record: Any = record, together: Any = together) -> None:
            together.wait()
            people.erase(two[1], record.id)

        with ThreadPoolExecutor(3) as threads:
            told = [one.result() for one in [threads.submit(work) for work in (answer_all, erase, erase)]]
        assert told[0] == "" or "found that it was withdrawn" in told[0]
    for table in response_tables.metadata.sorted_tables:
        with two[0].engine.connect() as connection:
            count = connection.execute(sa.select(sa.func.count()).select_from(table)).scalar_one()
        assert count == {"withdrawals": 8, "schema_version": len(MIGRATIONS)}.get(table.name, 0)


def away() -> Any:
    return sa.exc.OperationalError("SELECT 1", {}, Exception("connection refused"))


def test_a_database_that_comes_back_in_time_was_waited_for() -> None:
    failures, waits = [away(), away(), away()], []

    def work() -> str:
        if failures:
            raise failures.pop()
        return "done"

    assert patiently(work, "there", wait=waits.append, clock=lambda: sum(waits)) == "done"
    assert waits == [0.1, 0.2, 0.4]


def test_a_database_that_stays_away_is_told_of_and_other_faults_at_once() -> None:
    waits = []

    def work() -> None:
        raise away()

    said = r"there: expected a database that can be written to, found that for 5 s it could not be \(connection refused"
    with pytest.raises(SessionError, match=said):
        patiently(work, "there", patience_s=5, wait=waits.append, clock=lambda: sum(waits))
    assert 5 < sum(waits) < 8
    with pytest.raises(ZeroDivisionError):
        patiently(lambda: 1 / 0, "there", wait=waits.append)
