"""Numbers and sentences of the report: results of the analysis in, plain prose out."""

from __future__ import annotations

import re
from collections.abc import Sequence

from study.counting import counted, noun
from study.report.tables import p_value


def readable(name: str) -> str:
    """Return a name of a protocol as words."""
    return name.replace("_", " ")


def library(name: str) -> str:
    """Return a motion library's name; of a folder its last part, as no page should tell of the machine's disk."""
    return name.replace("\\", "/").rstrip("/").rsplit("/", 1)[-1]


def sentence(text: str) -> str:
    """Return a text with its first letter as a capital."""
    return text[:1].upper() + text[1:]


def joined(parts: Sequence[str]) -> str:
    """Return a list in words: a, b and c."""
    if len(parts) < 2:
        return "".join(parts)
    return ", ".join(parts[:-1]) + " and " + parts[-1]


def unbroken(text: str) -> str:
    """Return a text in which no line ends within "p < .001", "N = 280", "t(34) = 5.01", "k + 7.1" or "0.20 s"."""
    text = re.sub(r"(?<=\d) (?=s\b)", "\u00a0", text)
    text = re.sub(r"(?<=\S) ([=<+−±]) (?=[\d.−(])", "\u00a0\\1\u00a0", text)
    return re.sub(r"\((\d+), (?=\d|N\b)", "(\\1,\u00a0", text)


def mark_of(data: str, synthetic: bool) -> str:
    """Return the note below every figure whose data are not people's answers to captured motion."""
    parts = []
    if data == "simulated":
        parts.append("simulated answers, no people")
    elif data == "mixed":
        parts.append("people’s and simulated answers mixed")
    if synthetic:
        parts.append("synthetic motions, none captured")
    return " · ".join(parts)


def warnings_of(data: str, synthetic: bool, simulated: int, participants: int) -> list[str]:
    """Return the sentences at the top of the page, before any result."""
    found = []
    if data == "simulated":
        found.append(
            "These answers are simulated. A program drew them from observers with known sensitivity; nobody was "
            "asked, and the results say nothing about human perception."
        )
    elif data == "mixed":
        found.append(
            f"Simulated and collected answers are mixed here: {simulated} of {counted(participants, 'participant')} "
            f"{noun(simulated, 'is a simulated observer', 'are simulated observers')}. Results describe neither people "
            "nor the simulation."
        )
    if synthetic:
        found.append(
            "The motions are synthetic: a program generated them from published kinematics, without motion capture."
        )
    return found


def interval(low: float | None, high: float | None, places: int = 1, unit: str = "") -> str:
    """Return an interval in words, open ends included."""
    if low is None and high is None:
        return "no interval"
    if high is None:
        return f"{low:.{places}f}{unit} or more"
    if low is None:
        return f"{high:.{places}f}{unit} or less"
    return f"{low:.{places}f} to {high:.{places}f}{unit}"


def bare_interval(low: float | None, high: float | None, places: int = 1) -> str:
    """Return an interval as printed in brackets: "6.3, 7.7", an open end as a dash."""
    return f"{decimals(low, places)}, {decimals(high, places)}"


def decimals(value: float | None, places: int) -> str:
    """Return a number with a true minus sign; a dash where there is none."""
    return "–" if value is None else f"{value:.{places}f}".replace("-", "−")


def signed(value: float, places: int = 1, *, plus: bool = True) -> str:
    """Return a number with its sign."""
    return ("+" if plus and value >= 0 else "") + decimals(value, places)


def p(value: float) -> str:
    """Return a p-value in a sentence: p < .001, p = .012."""
    text = p_value(value)
    return f"p {text}" if text.startswith("<") else f"p = {text}"
