"""The confirmatory family of a protocol: preference studies in, their default tests adjusted together out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from study.analysis.estimates import holm
from study.analysis.preference.analyse import Preference


@dataclass(frozen=True)
class ConfirmatoryTest:
    """The default test of one comparison, and its p-value adjusted over the family; `note` says why there is none."""

    study: str
    method_a: str
    method_b: str
    test: str
    p_value: float | None
    note: str
    holm_p_value: float | None


def confirmatory(
    studies: Mapping[str, Preference], family: Sequence[str] | None = None
) -> tuple[ConfirmatoryTest, ...]:
    """Return the default tests of the confirmatory comparisons, adjusted together by Holm's method.

    Parameters
    ----------
    studies
        By name.
    family
        Names of the studies whose tests were declared confirmatory before there was data; all of them where None.
    """
    found = [
        (name, compared)
        for name, study in studies.items()
        if family is None or name in family
        for compared in study.comparisons
    ]
    adjusted = holm([compared.default.p_value for _, compared in found])
    return tuple(
        ConfirmatoryTest(
            study=name,
            method_a=compared.method_a,
            method_b=compared.method_b,
            test=compared.default.test,
            p_value=compared.default.p_value,
            note=compared.participants.note if p_value is None else "",
            holm_p_value=p_value,
        )
        for (name, compared), p_value in zip(found, adjusted, strict=True)
    )
