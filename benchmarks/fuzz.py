"""Feeds Segue damaged and extreme input, to find what is neither an answer nor a refusal.

    python benchmarks/fuzz.py [--cases 2000] [--seed 1] [--kinds bvh,protocol] [--workers 2] [--keep FOLDER] [--json]
    python benchmarks/fuzz.py --case protocol:1:417 --keep FOLDER       # one case again, and its files

Every case is drawn from its kind, its seed and its number alone, so any of them can be run again by itself. A case is
an input of one kind (below, KINDS) and the verbs that read it, which run in this process. What may come of it: exit
status 0 and a result in which no number is missing without a sentence that says why, or exit status 2 and one
refusal. All else is a find: a traceback, a warning that is not ours, more than 8 s of an ordinary processor's time,
more than 1 GB of memory, a status of the server that means a fault of its own. Exit status of this script: 1 where
there was a find.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import functools
import io
import json
import multiprocessing
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import fuzz_inputs as inputs

Generator = np.random.Generator

SECONDS, STUCK_SECONDS = 8.0, 120.0
"""Processor time that a case may take on an ordinary machine, and time by the clock, which counts waiting too."""
ORDINARY = 0.010
"""Seconds of processor time that `_some_work` takes there."""
MEGABYTES = 1024
"""What a case may add to the address space of this process."""


class LimitError(BaseException):
    """A case took too long. Not an `Exception`: the command line catches those."""


@dataclass(frozen=True)
class Outcome:
    """What came of a case: `accepted`, `refused`, or a find with what kind of fault it is and the details."""

    kind: str
    seed: int
    number: int
    result: str
    fault: str = ""
    details: str = ""
    seconds: float = 0.0

    @property
    def name(self) -> str:
        """What `--case` takes."""
        return f"{self.kind}:{self.seed}:{self.number}"


class FaultError(Exception):
    """What a case should not have led to."""


# -- Limits -----------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def limited() -> Iterator[None]:
    """Limits of time and memory on what runs inside; put back afterwards.

    A machine half as fast as an ordinary one, or one that others slow down just then, gives twice the time.
    """
    started = time.process_time()

    def over(signal_number: int, _: object) -> None:
        if signal_number == signal.SIGALRM:
            raise LimitError(f"over {STUCK_SECONDS:g} s by the clock")
        left = SECONDS * max(1.0, _some_work() / ORDINARY) - (time.process_time() - started)
        if left <= 0.0:
            raise LimitError(f"over {SECONDS:g} s of processor time")
        signal.setitimer(signal.ITIMER_PROF, left)

    before = {number: signal.signal(number, over) for number in (signal.SIGALRM, signal.SIGPROF)}
    space = resource.getrlimit(resource.RLIMIT_AS)
    # Where even a signal can't end it, a loop in C, the process ends and says where it was.
    faulthandler.dump_traceback_later(2 * STUCK_SECONDS, exit=True)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    signal.setitimer(signal.ITIMER_REAL, STUCK_SECONDS)
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (_address_space() + MEGABYTES * 2**20, space[1]))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        faulthandler.cancel_dump_traceback_later()
        resource.setrlimit(resource.RLIMIT_AS, space)
        for number, handler in before.items():
            signal.signal(number, handler)


def _some_work() -> float:
    """Seconds of processor time that a little work takes now."""
    started = time.process_time()
    sum(len(str(number * number)) for number in range(40_000))
    return time.process_time() - started


def _address_space() -> int:
    """Bytes of address space that this process has now (Linux)."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


@contextlib.contextmanager
def disk_full_after(size: int | None) -> Iterator[None]:
    """No file can grow beyond so many bytes, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    if size is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


# -- Verbs and what they may say --------------------------------------------------------------------------------------


def run_verb(*arguments: str) -> tuple[int, str]:
    """A verb in this process: its status, and what it printed. Raises `FaultError` for what a verb may not do."""
    from study.apps.cli import run

    printed, said = io.StringIO(), io.StringIO()
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said):
            status = run(arguments)
    if status not in (0, 2):
        raise FaultError(said.getvalue()[-6000:] or f"exit status {status}")
    _look_for_strange_warnings(said.getvalue())
    if status == 2 and not said.getvalue().strip() and '"problems"' not in printed.getvalue():
        raise FaultError("exit status 2 without a word")
    if status == 0 and "--json" in arguments:
        _look_for_missing_numbers(json.loads(printed.getvalue()))
    return status, printed.getvalue()


_FOREIGN_WARNING = re.compile(
    r"warning: .*(encountered in|invalid value|overflow|divide by zero|converge|deprecat|unclosed|ill-conditioned"
    r"|Mean of empty|Degrees of freedom|precision loss|All-NaN).*",
    re.IGNORECASE,
)


def _look_for_strange_warnings(said: str) -> None:
    if found := _FOREIGN_WARNING.search(said):
        raise FaultError(f"{said[-3000:]}\nWarning: {found.group()[:160]}")


def _look_for_missing_numbers(found: Any, path: str = "") -> None:
    """Refuse a result with `nan` in its words, or an estimate that is null beside no sentence."""
    if isinstance(found, str) and re.search(r"(?<![\w-])(nan|inf)(?!\w)", found):
        raise FaultError(f"Missing number: {path} says {found[:200]!r}")
    if isinstance(found, dict):
        silent = not any(isinstance(value, str) and value.count(" ") >= 2 for value in found.values())
        for name, value in found.items():
            if value is None and silent and name in ("percent", "estimate", "mean", "frames", "fps", "seconds", "size"):
                raise FaultError(f"Missing number: {path}.{name} is null, and nothing says why: {found}"[:1000])
            _look_for_missing_numbers(value, f"{path}.{name}")
    elif isinstance(found, list):
        for value in found:
            _look_for_missing_numbers(value, f"{path}[]")


# -- The kinds --------------------------------------------------------------------------------------------------------


def motion(generator: Generator, folder: Path) -> Callable[[], int]:
    """A BVH file: inspected, and where it can be read also written and read again."""
    file = folder / "walk.bvh"
    file.write_bytes(inputs.bvh(generator))
    return lambda: _inspected(file)


def acclaim(generator: Generator, folder: Path) -> Callable[[], int]:
    """An ASF skeleton and an AMC motion."""
    skeleton, frames = inputs.acclaim(generator)
    (folder / "1.asf").write_bytes(skeleton)
    (folder / "1_1.amc").write_bytes(frames)
    return lambda: _inspected(folder / "1_1.amc")


def gltf(generator: Generator, folder: Path) -> Callable[[], int]:
    """A glTF file."""
    (folder / "walk.glb").write_bytes(inputs.gltf(generator))
    return lambda: _inspected(folder / "walk.glb")


def _inspected(file: Path) -> int:
    from study.errors import SegueError
    from study.motion.readers.bvh_writing import write_bvh
    from study.motion.readers.registry import read_clip

    status, _ = run_verb("motions", "inspect", str(file), "--json")
    if status == 0:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            clip = read_clip(file)
            written = file.with_name("again.bvh")
            try:
                write_bvh(clip, written)
            except SegueError:
                return 2
            again = read_clip(written, metres_per_unit=0.01)
        if (again.frames, again.skeleton.joints) != (clip.frames, clip.skeleton.joints):
            raise FaultError(f"Written and read again: {clip.frames} frames, then {again.frames}")
    return status


def protocol(generator: Generator, folder: Path) -> Callable[[], int]:
    """A protocol, checked."""
    file = folder / "study.toml"
    file.write_bytes(inputs.protocol(generator))
    return lambda: run_verb("check", str(file), "--texts", "--json")[0]


def library(generator: Generator, folder: Path) -> Callable[[], int]:
    """A folder of motions with what somebody says about them, in a `library.toml`; one of them is loaded."""
    for name in ("walk.bvh", "run.bvh"):
        (folder / name).write_bytes(inputs.sound_bvh(generator))
    (folder / "library.toml").write_bytes(inputs.library(generator))

    def go() -> int:
        status, _ = run_verb("motions", "list", "--library", str(folder), "--json")
        return run_verb("cost-matrix", "walk", "run", "--library", str(folder), "--json")[0] if status == 0 else status

    return go


def table(generator: Generator, folder: Path) -> Callable[[], int]:
    """A table of answers that another program wrote."""
    content, options = inputs.table(generator)
    file = folder / "answers.csv"
    file.write_bytes(content)
    return lambda: run_verb("fit", str(file), *options, "--json")[0]


def results(generator: Generator, folder: Path) -> Callable[[], int]:
    """A results folder with something damaged in it, or on a disk that gets full."""
    place = folder / "results"
    shutil.copytree(_sound_results(), place)
    full = int(generator.integers(0, 200_000)) if generator.random() < 0.2 else None
    if full is None:
        inputs.damage(generator, place)
    verbs = (
        ("analyse", str(place), "--json"),
        ("export", str(place), "--json"),
        ("export", str(place), "--to", "psych-ds", "--json"),
        ("export", str(place), "--to", "bids", "--json"),
        ("simulate", str(place / "protocol.toml"), "--participants", "8", "--out", str(place), "--json"),
    )
    chosen = verbs[int(generator.choice(len(verbs), p=[0.35, 0.15, 0.15, 0.15, 0.2]))]

    def go() -> int:
        with disk_full_after(full):
            return run_verb(*chosen)[0]

    return go


@functools.cache
def _sound_results() -> Path:
    """A results folder with stimuli's records, no films, and six simulated participants."""
    folder = Path(tempfile.mkdtemp(prefix="segue-fuzz-"))
    file = folder / "study.toml"
    file.write_text(inputs.PROTOCOL, encoding="utf-8")
    status, _ = run_verb("simulate", str(file), "--participants", "6", "--out", str(folder / "results"))
    if status:
        raise FaultError("the sound results folder could not be made")
    return folder / "results"


def message(generator: Generator, folder: Path) -> Callable[[], int]:
    """What browsers and others send to the server, as the bytes of one connection."""
    from fuzz_server import converse

    del folder
    return lambda: converse(generator, _sound_results())


KINDS: Mapping[str, tuple[Callable[[Generator, Path], Callable[[], int]], float]] = {
    "bvh": (motion, 0.24),
    "acclaim": (acclaim, 0.16),
    "library": (library, 0.07),
    "protocol": (protocol, 0.20),
    "table": (table, 0.08),
    "results": (results, 0.05),
    "message": (message, 0.10),
    "gltf": (gltf, 0.10),
}
"""Each kind of input, and its share of the cases."""


# -- Running ----------------------------------------------------------------------------------------------------------


def run_case(kind: str, seed: int, number: int, keep: Path | None = None) -> Outcome:
    """One case; its files stay in `keep` where it is a find."""
    make, _ = KINDS[kind]
    generator = np.random.default_rng([seed, list(KINDS).index(kind), number])
    folder = Path(tempfile.mkdtemp(prefix="segue-fuzz-"))
    if kind in ("results", "message"):
        _sound_results()
    started = time.process_time()
    result, fault, details = "fault", "", ""
    try:
        go = make(generator, folder)
        with limited():
            result = ("accepted", "", "refused")[go()]
    except FaultError as found:
        fault, details = _fault_of(str(found)), str(found)
    except (LimitError, Exception) as found:
        details = traceback.format_exc()
        fault = f"{found} in {_place(details)}" if isinstance(found, LimitError) else _fault_of(details)
    outcome = Outcome(kind, seed, number, result, fault, details, time.process_time() - started)
    if keep is not None and (result == "fault"):
        kept = keep / outcome.name.replace(":", "-")
        shutil.copytree(folder, kept, dirs_exist_ok=True)
        (kept / "fault.txt").write_text(f"{fault}\n\n{details}", encoding="utf-8")
    shutil.rmtree(folder, ignore_errors=True)
    return outcome


def _fault_of(details: str) -> str:
    """What to count a find under: the last line of a traceback and the last place of ours in it."""
    named = re.findall(
        r"^((?:\w+\.)*\w*(?:Error|Exception|Warning|Iteration|number|again|HTTP)\b.*)", details, re.MULTILINE
    )
    last = named[-1] if named else details.strip().splitlines()[-1]
    return f"{re.sub(r'[0-9]+', 'N', last)[:90]} in {_place(details)}"


def _place(details: str) -> str:
    places = re.findall(r'File "[^"]*?((?:study|renderer)/[^"]+)", line (\d+), in (\w+)', details)
    return "{}:{} {}".format(*places[-1]) if places else "-"


def cases(count: int, kinds: Sequence[str]) -> list[tuple[str, int]]:
    """Kind and number of each of so many cases, the kinds by their shares."""
    whole = sum(KINDS[kind][1] for kind in kinds)
    return [(kind, number) for kind in kinds for number in range(round(count * KINDS[kind][1] / whole))]


def _run_chunk(chunk: tuple[int, Path | None, list[tuple[str, int]]]) -> list[Outcome]:
    seed, keep, chosen = chunk
    return [run_case(kind, seed, number, keep) for kind, number in chosen]


def run_all(count: int, seed: int, kinds: Sequence[str], workers: int, keep: Path | None) -> Iterator[Outcome]:
    """Cases in several processes, as they are done."""
    chosen = cases(count, kinds)
    # Small pieces that mix the kinds keep all processes busy to the end.
    pieces = max(1, len(chosen) // 25)
    chunks = [(seed, keep, chosen[first::pieces]) for first in range(pieces)]
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for done in as_completed([pool.submit(_run_chunk, chunk) for chunk in chunks]):
            yield from done.result()


def summarise(outcomes: Sequence[Outcome], seconds: float) -> dict[str, Any]:
    """Counts by kind, and each fault once with how often and the first case that has it."""
    counts = {kind: Counter(o.result for o in outcomes if o.kind == kind) for kind in KINDS}
    found: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.result == "fault":
            found.setdefault(outcome.fault, []).append(outcome)
    slowest = max(outcomes, key=lambda o: o.seconds)
    return {
        "cases": len(outcomes),
        "counts": {kind: dict(count) for kind, count in counts.items() if count},
        "faults": [
            {"fault": fault, "times": len(those), "case": min(those, key=lambda o: o.number).name}
            for fault, those in sorted(found.items(), key=lambda item: -len(item[1]))
        ],
        "slowest": {"case": slowest.name, "seconds": round(slowest.seconds, 2)},
        "seconds": round(seconds, 1),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", default=",".join(KINDS), help=f"some of {', '.join(KINDS)}")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder for the files of every find")
    parser.add_argument("--case", help="one case again: KIND:SEED:NUMBER")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    if unknown := set(options.kinds.split(",")) - set(KINDS):
        parser.error(f"expected kinds out of {', '.join(KINDS)}, found {', '.join(unknown)}")
    if options.case:
        kind, seed, number = options.case.split(":")
        outcome = run_case(kind, int(seed), int(number), options.keep)
        print(json.dumps(asdict(outcome), indent=2) if options.json else f"{outcome.result}\n{outcome.details}")
        return int(outcome.result == "fault")
    started = time.monotonic()
    outcomes: list[Outcome] = []
    for outcome in run_all(options.cases, options.seed, options.kinds.split(","), options.workers, options.keep):
        outcomes.append(outcome)
        if outcome.result == "fault":
            print(f"{outcome.name}: {outcome.fault}", file=sys.stderr, flush=True)
        elif len(outcomes) % 1000 == 0:
            print(f"{len(outcomes)} cases", file=sys.stderr, flush=True)
    summary = summarise(outcomes, time.monotonic() - started)
    if options.json:
        print(json.dumps(summary, indent=2))
    else:
        print(f"{summary['cases']} cases in {summary['seconds']} s, the slowest {summary['slowest']}")
        for kind, counted in summary["counts"].items():
            print(f"{kind:10} " + ", ".join(f"{number} {result}" for result, number in sorted(counted.items())))
        for fault in summary["faults"]:
            print(f"FAULT {fault['times']:5} x {fault['fault']}\n      again by --case {fault['case']}")
    return int(bool(summary["faults"]))


if __name__ == "__main__":
    sys.exit(main())
