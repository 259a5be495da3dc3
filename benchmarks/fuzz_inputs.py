"""Inputs for `fuzz.py`: sound ones, then damaged by small and large mistakes. A generator comes in, bytes go out.

Some of them are built, not damaged: deep or wide skeletons, one name many times, long words, tables of few answers.
"""

from __future__ import annotations

import functools
import itertools
import json
import re
import sqlite3
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

Generator = np.random.Generator

NUMBERS = (
    "nan", "inf", "-inf", "-0", "0", "-1", "1e308", "-1.7e308", "1e309", "1e-309", "5e-324", "1e9999999", "1e-9999999",
    "9" * 5000, "0." + "0" * 400 + "1", "1_000", "0x7f", "٣", "1,5", "--1", "1e", "2147483648", "9223372036854775807",
    "9223372036854775808", "18446744073709551616", "1e5", "1e15", "1e100", "1e154", "-1e200", "0.5", "1", "2", "true",
    '""', "[]", "{}", "'a'", "1979-05-27", "0b" + "1" * 20_000, "0x" + "f" * 5000, "3.5", "-5", "100000", "1e-5", "30",
    "3", "4", "7", "0.25", "0.9", "0.99", "1.5", "12.0", "20", "45", "60", "-2", "240", "600", "0.001", "1e-3", "90",
)  # fmt: skip
_PLAUSIBLE = (
    "0", "1", "2", "3", "5", "12", "24", "60", "0.0", "0.1", "0.5", "0.95", "1.0", "1.5", "30.0", "1e-9", "true",
    "false", '"random"', '"balanced"', '"both"', '"by-group"', '"as-listed"', '"walk"', '"jog"', '"stand"',
    '"geodesic"', '"cut"', '"fixed"', '"velocity"', '"timewarp"', '"cut-wang2003"', '"one-hop"', '"front"',
    '"clearest"', '"de"', '"ja"', '"xx"', '"text"', '"choice"', '"{standard}"', '"pair"', '"rating"',
    '"preference"', '"walk_run"', '"jnd"', '"liking"', '"x"',
)  # fmt: skip
WORDS = (
    "", " ", "a", "A" * 300, "word" * 2500, "=1+1", "@x", "-", "_", ".", "..", "../x", "con", "é", "日本語",
    "\u202e", "\ufeff", "\0", "\x1b[31m", "{standard}", "{nonsense}", "{", "}", "%s", "${x}", "<b>", "&amp;",
    "'", '"', "\\", "ROOT", "MOTION", "End", ":root", "begin", "end", "#", ",", ";", "\t", "\r",
    "None", "null", "first", "second", "same", "1 2",
)  # fmt: skip


def pick(generator: Generator, choices: Sequence[Any]) -> Any:
    """One of several."""
    return choices[int(generator.integers(len(choices)))]


# -- Damage to any text -----------------------------------------------------------------------------------------------

_NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?![\w.])")
_WORD = re.compile(rb"\w+")
_VALUE = re.compile(rb"= *(.+)")


def damaged(generator: Generator, content: bytes, most: int = 3) -> bytes:
    """The content after one to `most` mistakes."""
    for _ in range(int(generator.integers(1, most + 1))):
        content = pick(generator, _MISTAKES)(generator, content)
    return content


def _replaced(generator: Generator, content: bytes, pattern: re.Pattern[bytes], words: Sequence[str]) -> bytes:
    found = list(pattern.finditer(content))
    if not found:
        return content
    where = pick(generator, found)
    group = 1 if pattern.groups else 0
    return content[: where.start(group)] + pick(generator, words).encode() + content[where.end(group) :]


def _number(generator: Generator, content: bytes) -> bytes:
    return _replaced(generator, content, _NUMBER, NUMBERS)


def _value(generator: Generator, content: bytes) -> bytes:
    return _replaced(generator, content, _VALUE, NUMBERS)


def _word(generator: Generator, content: bytes) -> bytes:
    return _replaced(generator, content, _WORD, WORDS)


def _word_of_the_file(generator: Generator, content: bytes) -> bytes:
    words = [word.decode("utf-8", "replace") for word in _WORD.findall(content)[:500]] or ["a"]
    return _replaced(generator, content, _WORD, words)


def _span(generator: Generator, content: bytes) -> tuple[int, int]:
    start = int(generator.integers(0, len(content) + 1))
    return start, min(len(content), start + int(generator.integers(1, 80)))


def _cut_out(generator: Generator, content: bytes) -> bytes:
    start, stop = _span(generator, content)
    return content[:start] + content[stop:]


def _repeat(generator: Generator, content: bytes) -> bytes:
    start, stop = _span(generator, content)
    return content[:stop] + content[start:stop] * int(pick(generator, (1, 2, 50))) + content[stop:]


def _bytes(generator: Generator, content: bytes) -> bytes:
    changed = bytearray(content or b" ")
    for _ in range(int(generator.integers(1, 5))):
        changed[int(generator.integers(len(changed)))] = int(generator.integers(256))
    return bytes(changed)


def _insert(generator: Generator, content: bytes) -> bytes:
    at = int(generator.integers(0, len(content) + 1))
    return content[:at] + pick(generator, WORDS + NUMBERS).encode() + content[at:]


def _truncate(generator: Generator, content: bytes) -> bytes:
    return content[: int(generator.integers(0, len(content) + 1))]


def _lines(generator: Generator, content: bytes) -> bytes:
    lines = content.split(b"\n")
    a, b = (int(generator.integers(len(lines))) for _ in range(2))
    how = int(generator.integers(4))
    if how == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif how == 1:
        del lines[a]
    elif how == 2:
        lines.insert(a, lines[b])
    else:
        lines[a:a] = [lines[b]] * 300
    return b"\n".join(lines)


def _encoding(generator: Generator, content: bytes) -> bytes:
    how = int(generator.integers(5))
    if how == 0:
        return b"\xef\xbb\xbf" + content
    if how == 1:
        return content.replace(b"\n", b"\r\n")
    if how == 2:
        return content.replace(b"\n", b"\r")
    if how == 3:
        return content.decode("utf-8", "replace").encode("utf-16")
    return content.replace(b" ", b"\t")


_MISTAKES = (
    _number, _number, _number, _value, _value, _word, _word, _word_of_the_file, _cut_out, _repeat, _bytes, _insert,
    _truncate, _lines, _lines, _encoding,
)  # fmt: skip


# -- Motion files -----------------------------------------------------------------------------------------------------

_SIDES = ("Left", "Right")
_LEG = (("UpLeg", "9 -2 0"), ("Leg", "0 -41 0"), ("Foot", "0 -40 0"), ("ToeBase", "0 -5 12"))
_ARM = (("Shoulder", "4 10 0"), ("Arm", "10 0 0"), ("ForeArm", "28 0 0"), ("Hand", "25 0 0"))


def _tree() -> list[tuple[int, str, str]]:
    """A small body: depth, name and offset of each joint, depth first."""
    joints = [(0, "Hips", "0 95 0")]
    for side in _SIDES:
        joints += [(depth + 1, side + name, _mirrored(side, offset)) for depth, (name, offset) in enumerate(_LEG)]
    joints += [(1, "Spine", "0 12 0"), (2, "Neck", "0 35 0"), (3, "Head", "0 10 0")]
    for side in _SIDES:
        joints += [(depth + 2, side + name, _mirrored(side, offset)) for depth, (name, offset) in enumerate(_ARM)]
    return joints


def _mirrored(side: str, offset: str) -> str:
    return f"-{offset}".replace("--", "") if side == "Right" else offset


def _bvh_text(
    joints: Sequence[tuple[int, str, str]], rows: int, generator: Generator, channels: bool = True, turn: float = 2.0
) -> bytes:
    """A BVH file of a tree of joints; without channels but for the root's where `channels` is false."""
    lines = ["HIERARCHY"]
    for number, (depth, name, offset) in enumerate(joints):
        last = number + 1 == len(joints)
        up = joints[number + 1][0] if not last else 0
        own = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
        if depth:
            own = "CHANNELS 3 Zrotation Xrotation Yrotation" if channels else ""
        lines += [f"{'JOINT' if depth else 'ROOT'} {name}", "{", f"OFFSET {offset}", own]
        if last or up <= depth:
            lines += ["End Site", "{", "OFFSET 0 3 0", "}"]
            lines += ["}"] * (depth + 1 - up)
    columns = 6 + (3 * (len(joints) - 1) if channels else 0)
    values = np.cumsum(generator.normal(0.0, turn, (rows, columns)), axis=0)
    lines += ["MOTION", f"Frames: {rows}", "Frame Time: 0.033333"]
    lines += [" ".join(f"{value:.4f}" for value in row) for row in values]
    return "\n".join(lines).encode() + b"\n"


def _large_bvh(generator: Generator) -> bytes:
    """Many joints, deep or wide, of different names or one; or a long name; or many frames of few numbers."""
    how = int(generator.integers(7))
    size = int(pick(generator, (1100, 3000, 5000, 8000, 20_000)))
    if how == 0:
        return _bvh_text([(k, f"j{k}", "0 1 0") for k in range(min(size, 5000))], 2, generator)
    if how == 1:
        return _bvh_text([(min(k, 1), f"j{k}", "0 1 0") for k in range(size)], 2, generator)
    if how == 2:
        return _bvh_text([(min(k, 1), "same", "0 1 0") for k in range(min(size, 8000))], 2, generator)
    if how == 3:
        name = pick(generator, ("x" * 100_000, "left" * 20_000, "L_" * 30_000, "a:" * 30_000, " " * 50_000 + "y"))
        return _bvh_text([(0, name, "0 1 0"), (1, name[::-1] or "b", "0 1 0")], 3, generator)
    if how == 4:
        names = [f"{side}{part}" for side in ("Left", "Right", "l_") for part in ("UpLeg", "Foot", "Hand", "Toe")]
        chain = [(k, f"{names[k % len(names)]}{k}", "0 1 0") for k in range(min(size, 3000))]
        return _bvh_text(chain, 2, generator, channels=False)
    if how == 5:
        text = _bvh_text([(min(k, 1), f"j{k}", "0 1 0") for k in range(400)], 1, generator, channels=False)
        return text + b"0 0 0 0 0 0\n" * int(pick(generator, (20_000, 60_000)))
    deep = "{" * size if generator.random() < 0.5 else "ROOT a { " * size
    return f"HIERARCHY\n{deep}".encode()


def bvh(generator: Generator) -> bytes:
    """A BVH file with mistakes; a large one now and then."""
    if generator.random() < 0.015:
        return _large_bvh(generator)
    return damaged(
        generator, _bvh_text(_tree(), int(generator.integers(1, 12)), generator), int(pick(generator, (1, 1, 2, 4)))
    )


def sound_bvh(generator: Generator) -> bytes:
    """A BVH file without mistakes."""
    return _bvh_text(_tree(), 20, generator, turn=0.2)


@functools.cache
def _sound_glb() -> bytes:
    """The same as a glTF file."""
    from study.motion.readers.gltf_writing import write_glb
    from study.motion.readers.registry import read_clip

    with tempfile.TemporaryDirectory() as folder:
        bvh_file, glb_file = Path(folder, "walk.bvh"), Path(folder, "walk.glb")
        bvh_file.write_bytes(sound_bvh(np.random.default_rng(1)))
        write_glb({"walk": read_clip(bvh_file, metres_per_unit=0.01)}, glb_file)
        return glb_file.read_bytes()


def gltf(generator: Generator) -> bytes:
    """A glTF file with mistakes: in its JSON, in its numbers, or anywhere."""
    from study.motion.readers.gltf_file import pack

    content = _sound_glb()
    if generator.random() < 0.1:
        return damaged(generator, content)
    end = 20 + int.from_bytes(content[12:16], "little")
    text, binary = content[20:end], content[end + 8 :]
    if generator.random() < 0.8:
        text = damaged(generator, text, int(pick(generator, (1, 1, 2, 4))))
    else:
        binary = damaged(generator, binary)
    return pack(text, binary)


_LIBRARY = """\
[defaults]
unit = "cm"

[clips.walk]
file = "walk.bvh"
category = "walking"
fps = 30.0
cyclic = false
beats = [0.1, 0.3]

[clips.turned]
file = "run.bvh"
mirror = true
first_frame = 1
last_frame = 15

[clips.turned.joints]
pelvis = "Hips"
"""


def library(generator: Generator) -> bytes:
    """A `library.toml` with mistakes."""
    if generator.random() < 0.03:
        size = int(pick(generator, (300, 5000, 30_000)))
        return (_LIBRARY + f"deep = {'[' * size}{']' * size}\n").encode()
    return (
        _with_other_values(generator, _LIBRARY)
        if generator.random() < 0.6
        else damaged(generator, _LIBRARY.encode(), 2)
    )


def _with_other_values(generator: Generator, text: str) -> bytes:
    """One or two sound lines with another value: mistakes that the TOML survives."""
    for _ in range(int(generator.integers(1, 3))):
        line = pick(generator, list(_KEYS.finditer(text)))
        how = generator.random()
        value = (
            pick(generator, _PLAUSIBLE if how < 0.4 else NUMBERS) if how < 0.7 else json.dumps(pick(generator, WORDS))
        )
        value = f"[{', '.join([value] * int(generator.integers(1, 4)))}]" if generator.random() < 0.2 else value
        text = text[: line.start()] + f"{line[1]} = {value}" + text[line.end() :]
    return text.encode("utf-8", "replace")


_ASF = """\
:version 1.10
:name body
:units
  mass 1.0
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
"""


def acclaim(generator: Generator) -> tuple[bytes, bytes]:
    """An ASF skeleton and an AMC motion, one of them or both with mistakes; now and then a large one."""
    names = ["lowerback", "head"]
    children = {"root": ["lhipjoint", "rhipjoint", "lowerback"], "lowerback": ["head"]}
    for side in "lr":
        leg = [f"{side}{part}" for part in ("hipjoint", "femur", "tibia", "foot")]
        names += leg
        children |= {parent: [child] for parent, child in itertools.pairwise(leg)}
    if generator.random() < 0.02:
        names += [f"b{k}" for k in range(int(pick(generator, (1500, 6000, 15_000))))]
        many = [name for name in names if re.fullmatch(r"b\d+", name)]
        if generator.random() < 0.5:
            children |= {"head": many}
        else:
            children |= {parent: [child] for parent, child in itertools.pairwise(["head", *many])}
    free = {name: pick(generator, (("rx", "ry", "rz"), ("rx",), ())) for name in names}
    if generator.random() < 0.1:
        free = dict.fromkeys(names, ())
    skeleton = _ASF if generator.random() < 0.95 else _ASF.replace("TX TY TZ RX RY RZ", "")
    for number, name in enumerate(names):
        dof = f"  dof {' '.join(free[name])}\n" if free[name] else ""
        skeleton += (
            f"begin\n  id {number}\n  name {name}\n  direction 0.1 -1 0.2\n  length 7\n  axis 0 0 20 XYZ\n{dof}end\n"
        )
    skeleton += ":hierarchy\nbegin\n" + "".join(f"  {p} {' '.join(c)}\n" for p, c in children.items() if c) + "end\n"
    rows = [":FULLY-SPECIFIED", ":DEGREES"]
    for frame in range(int(generator.integers(1, 6))):
        rows += [str(frame + 1)]
        rows += ["root 0 17 0 1 2 3"] if "TX" in skeleton else []
        rows += [" ".join([name, *(f"{generator.normal():.3f}" for _ in free[name])]) for name in names if free[name]]
    frames = "\n".join(rows) + "\n"
    which = int(generator.integers(3))
    first, second = skeleton.encode(), frames.encode()
    return (
        damaged(generator, first, 2) if which in (0, 2) else first,
        damaged(generator, second, 2) if which in (1, 2) else second,
    )


# -- Protocols --------------------------------------------------------------------------------------------------------

PROTOCOL = """\
name = "fuzzed"
title = "How movements join"
source = "nowhere"
fps = 30
seed = 5
participants = 12
study_order = "random"
language = "en"

[consent]
text = "{standard} Do you take part? It takes {minutes} minutes."
contact = "A person"

[[form]]
name = "age"
label = "Your age"
kind = "number"
least = 18
most = 99
required = true

[[form]]
name = "remark"
label = "Anything else"

[[form]]
name = "hand"
label = "Which hand?"
kind = "choice"
choices = ["left", "right"]

[keys]
same = "s"
different = "d"

[stimuli]
width = 160
height = 120
view = "side"
track_s = 1.5
entry_s = 0.3
exit_s = 0.3
weight = "sigmoid"

[stimuli.colours]
left = "#203040"

[timing]
gap_s = 0.1
pause_s = 0.1
answer_s = 3.0
break_after = 3
show_again = 1

[points]
shortest_frames = 4
longest_frames = 20
source_within = [0.1, 0.9]

[texts]
welcome = "Thank you for taking part in {studies} studies."
debrief = "That was about passages."

[analysis]
threshold = 0.75
alpha = 0.05
confirmatory = ["liking"]

[analysis.exclusions]
fastest_s = 0.2
most_missed = 0.2

[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "jog"

[[studies]]
name = "jnd"
task = "same-different"
reference = "geodesic"
differences_frames = [-2, 0, 3]
order = "both"
question = "Were they the same?"
instructions = "Say within three seconds whether they were the same."
practice = 1
attention_checks = 1
repeats = 1

[[studies]]
name = "liking"
task = "preference"
reference = "geodesic"
comparison = "fixed"
fixed_frames = 10
order = "by-group"
question = "Which was more natural?"

[[studies]]
name = "rating"
task = "rating"
reference = "geodesic"
comparison = "cut"
order = "by-group"
scale_points = 7

[[studies.items]]
name = "natural"
question = "How natural was it?"
low = "not at all"
high = "very"
"""
_KEYS = re.compile(r"^([a-z_]+) = .*$", re.MULTILINE)


def protocol(generator: Generator) -> bytes:
    """A protocol with mistakes; large or deep now and then."""
    text = PROTOCOL
    if generator.random() < 0.04:
        return _large_protocol(generator).encode("utf-8", "replace")
    if generator.random() < 0.6:
        return _with_other_values(generator, text)
    return damaged(generator, text.encode(), 2)


def _large_protocol(generator: Generator) -> str:
    size = int(pick(generator, (300, 3000, 8000, 30_000)))
    letters = (
        pick(generator, ("a", "ab", "1", "1.", "one ", "five", "秒", " ", "\\n", "[", "{", "=", "{minutes}")) * size
    )
    how = int(generator.integers(9))
    if how == 0:
        return PROTOCOL.replace("Say within three", f"{letters} Say within three")
    if how == 1:
        return PROTOCOL.replace('title = "How movements join"', f'title = """\n[{letters}\n"""\nwrong = 1')
    if how == 2:
        return PROTOCOL + f"deep = {'[' * size}{']' * size}\n"
    if how == 3:
        return PROTOCOL + f"{'.'.join(['a'] * size)} = 1\n"
    if how == 4:
        return PROTOCOL + "".join(f"unknown{k} = {k}\n" for k in range(min(size, 8000)))
    if how == 5:
        more = "".join(
            f'[[transitions]]\nname = "t{k}"\ncategory = "c"\nsource = "walk"\ndestination = "nowhere"\n'
            for k in range(min(size, 1500))
        )
        return PROTOCOL + more
    if how == 6:
        return PROTOCOL.replace("[-2, 0, 3]", f"[{', '.join(map(str, range(size)))}]")
    if how == 7:
        name = pick(generator, ("a", "ab", "a-b_")) * size
        return PROTOCOL.replace('"walk_run"', f'"{name}"').replace("repeats = 1", f'transitions = ["{name}b"]')
    return PROTOCOL.replace("repeats = 1", f'{"x" * size} = 1\ntask2 = "{letters[:50]}"')


# -- Tables -----------------------------------------------------------------------------------------------------------


def table(generator: Generator) -> tuple[bytes, tuple[str, ...]]:
    """A few answers of a few people, of all degrees of agreement; and the options that `fit` needs for it."""
    task = pick(generator, ("preference", "preference", "preference", "rating", "same-different", "2afc", "yes-no"))
    people, answers = (
        int(pick(generator, (1, 2, 3, 4, 4, 5, 7, 12))),
        int(pick(generator, (1, 4, 6, 8, 10, 12, 16, 40))),
    )
    agree, motions = float(generator.choice([0.0, 0.5, 0.7, 0.9, 1.0])), int(generator.integers(1, 4))
    methods = ("geo", "fix", "cut")[: int(pick(generator, (2, 2, 2, 3)))]
    rows = []
    # Who has how many answers is chance, too: small unequal tables are where models fail.
    for person in generator.integers(people, size=answers):
        a, b = (str(name) for name in generator.permutation(methods)[:2])
        level = int(generator.integers(-3, 4))
        right = generator.random() < agree
        answer = {
            "preference": ("first" if a < b else "second") if right else pick(generator, ("first", "second")),
            "rating": str(int(generator.integers(1, 6)) if not right else 4 + (a == methods[0])),
            "same-different": "different" if (level != 0) == right else "same",
        }.get(task, "1" if right or generator.random() < 0.5 else "0")
        rows.append((f"s{person}", a, b, f"m{generator.integers(motions)}", level, f"i{level % 2}", answer))
    lines = ["participant,first,second,motion,level,item,answer", *(",".join(map(str, row)) for row in rows)]
    content = ("\n".join(lines) + "\n").encode()
    if generator.random() < 0.4:
        content = damaged(generator, content, 2)
    own = {
        "preference": ("--first", "first", "--second", "second", "--motion", "motion"),
        "rating": ("--method", "first", "--motion", "motion", "--item", "item"),
    }.get(task, ("--level", "level"))
    return content, ("--task", task, "--answer", "answer", "--participant", "participant", *own)


# -- Results folders --------------------------------------------------------------------------------------------------


def damage(generator: Generator, folder: Path) -> None:
    """Something wrong in a results folder: its database, its record of the stimuli, its protocol, or a file gone."""
    how = pick(
        generator, (_zero_page, _zero_page, _bytes_of_database, _manifest, _manifest, _manifest, _text, _gone, _rows)
    )
    how(generator, folder)


def _zero_page(generator: Generator, folder: Path) -> None:
    file = folder / "responses.sqlite"
    content = bytearray(file.read_bytes())
    page = int(generator.integers(len(content) // 4096))
    content[page * 4096 : page * 4096 + 4096] = bytes(4096)
    file.write_bytes(content)


def _bytes_of_database(generator: Generator, folder: Path) -> None:
    file = folder / "responses.sqlite"
    file.write_bytes((_bytes if generator.random() < 0.6 else _truncate)(generator, file.read_bytes()))


def _manifest(generator: Generator, folder: Path) -> None:
    """A key that lacks, or a value of another kind, anywhere in the record of the stimuli."""
    file = folder / "manifest.json"
    content = json.loads(file.read_text(encoding="utf-8"))
    places: list[tuple[Any, Any]] = []

    def walk(part: Any) -> None:
        keys = list(part) if isinstance(part, dict) else range(len(part)) if isinstance(part, list) else ()
        for key in keys:
            places.append((part, key))
            walk(part[key])

    walk(content)
    part, key = pick(generator, places)
    if generator.random() < 0.5:
        del part[key]
    else:
        part[key] = pick(generator, (None, -1, 1e308, "x", [], {}, True, 10**30, float("nan"), "../../etc/passwd"))
    file.write_text(json.dumps(content), encoding="utf-8")


def _text(generator: Generator, folder: Path) -> None:
    file = folder / pick(generator, ("manifest.json", "protocol.toml"))
    file.write_bytes(damaged(generator, file.read_bytes(), 2))


def _gone(generator: Generator, folder: Path) -> None:
    """A file that lacks, is empty, or is a folder."""
    file = folder / pick(generator, ("manifest.json", "protocol.toml", "responses.sqlite"))
    file.unlink()
    how = int(generator.integers(3))
    if how == 1:
        file.touch()
    elif how == 2:
        file.mkdir()


def _rows(generator: Generator, folder: Path) -> None:
    """A cell of the database with another value, or a table that lacks."""
    with sqlite3.connect(folder / "responses.sqlite") as database:
        tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        chosen = pick(generator, tables)
        if generator.random() < 0.2:
            database.execute("PRAGMA foreign_keys = OFF")
            database.execute(f'DROP TABLE "{chosen}"')
            return
        columns = [row[1] for row in database.execute(f'PRAGMA table_info("{chosen}")')]
        value = pick(generator, (None, "", "x", -1, 1e308, 2**62, b"\xff\x00", "null", "{}", "nan", "9" * 5000))
        try:
            database.execute(f'UPDATE "{chosen}" SET "{pick(generator, columns)}" = ?', (value,))
        except sqlite3.IntegrityError:
            return
