"""Counts in sentences: a number with its noun, so that no message speaks of 1 participants."""

from __future__ import annotations


def counted(count: float, singular: str, plural: str | None = None) -> str:
    """A count with its noun, thousands set apart.

    Examples
    --------
    >>> counted(1, "participant"), counted(2500, "answer"), counted(2, "study", "studies")
    ('1 participant', '2,500 answers', '2 studies')
    """
    number = f"{int(count):,}" if count == int(count) else f"{count:,g}"
    return f"{number} {noun(count, singular, plural)}"


def noun(count: float, singular: str, plural: str | None = None) -> str:
    """The noun alone, or any words that go with one or with several, such as "is" and "are"."""
    return singular if count == 1 else plural or f"{singular}s"
