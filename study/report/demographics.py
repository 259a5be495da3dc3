"""Who took part, by the form: its answers in, a table and a sentence out that give nobody away.

Choices that fewer than five people made are counted together, with the next rarer one where they are fewer than five in
all, so that no small count can be had by subtraction. Written texts are never shown.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from statistics import mean, stdev
from typing import Any

from study.experiment.form import FEWEST, told_together
from study.experiment.protocol.texts import FormField
from study.report import tables, words


def demographics_rows(form: Sequence[FormField], given: Mapping[str, Sequence[str]]) -> list[dict[str, Any]]:
    """Return a row for each number of the form, and for each choice.

    Parameters
    ----------
    form
        Questions of the protocol.
    given
        Answers of those who took part, by the question's name; empty where a question was skipped.
    """
    return [
        {"item": field.label.rstrip("?:"), **row}
        for field in form
        for row in _rows(field, [value for value in given.get(field.name, ()) if value])
    ]


def _rows(field: FormField, values: Sequence[str]) -> Iterator[dict[str, Any]]:
    if len(values) < FEWEST or field.kind == "text":
        return
    if field.kind == "number":
        numbers = [float(value) for value in values]
        yield {"participants": len(values), "mean": mean(numbers), "standard_deviation": stdev(numbers)}
        return
    counts = {choice: count for choice in field.choices if (count := values.count(choice))}
    together = [choice for choice in counts if choice in told_together(counts)]
    yield from ({"reading": one, "participants": count} for one, count in counts.items() if one not in together)
    if together:
        count = sum(counts[choice] for choice in together)
        yield {"reading": f"{words.joined(together)} together", "participants": count}


def demographics_table(rows: Sequence[Mapping[str, Any]]) -> tables.Table:
    """Return the answers to the form."""
    return tables.make(
        "demographics",
        f"Participants by the form. Answers that fewer than {FEWEST} gave are counted together; texts are not shown.",
        "item reading participants mean standard_deviation",
        rows,
        headings={"reading": "answer"},
    )


def demographics_sentence(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return them for a Methods section; empty where there is nothing to tell."""
    told: dict[str, list[str]] = {}
    for row in rows:
        said = (
            f"{row['reading']} {row['participants']}"
            if "reading" in row
            else f"mean {row['mean']:.1f} (SD {row['standard_deviation']:.1f})"
        )
        told.setdefault(str(row["item"]), []).append(said)
    parts = [f"{item}: {', '.join(answers)}" for item, answers in told.items()]
    return f"They answered in the form: {'; '.join(parts)}. " if parts else ""
