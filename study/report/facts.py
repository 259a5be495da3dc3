"""What a report says of its material: who answered, what was shown, with which versions; sentences out."""

from __future__ import annotations

import hashlib
import platform

import numpy as np

import study
from study.analysis.analyse import Analysis
from study.analysis.quality import Quality
from study.counting import counted
from study.report import words
from study.report.material import Material


def who(quality: Quality) -> str:
    """Return who answered: "12 participants", "35 simulated observers", or both."""
    simulated = quality.simulated_participants
    people = quality.participants - simulated
    parts = [counted(people, "participant")] if people else []
    return words.joined([*parts, *([counted(simulated, "simulated observer")] if simulated else [])])


def facts(material: Material, analysis: Analysis) -> tuple[str, ...]:
    """Return what stands at the head of the page: who answered, how much, what was shown, how sure results are."""
    manifest, quality = material.manifest, analysis.quality
    motions = (
        "synthetic motions"
        if manifest.synthetic
        else f"captured motions of the library {words.library(manifest.library)}"
    )
    return (
        who(quality),
        f"{counted(quality.answered, 'answer')}, {quality.missed:,} missed",
        f"{counted(len(manifest.records), 'stimulus', 'stimuli')} at {manifest.fps:g} frames per second",
        motions,
        f"significance level {analysis.alpha:g}, intervals of {100 * analysis.confidence:g}%",
    )


def sessions_sentence(material: Material) -> str:
    """Return sessions without answers, and participants who withdrew."""
    parts = []
    empty = len(material.sessions) - material.answers["participant"].nunique()
    if empty > 0:
        parts.append(f"{counted(empty, 'session')} without an analysed response")
    if material.withdrawn:
        parts.append(f"{counted(material.withdrawn, 'participant')} withdrew, and their answers are deleted")
    return f"Beside these: {words.joined(parts)}." if parts else ""


def shown_sentence(material: Material) -> str:
    """Return how many stimuli there are, of what motions."""
    manifest = material.manifest
    extended = sum(
        any(use.added_before or use.added_after for use in (record.source, record.destination))
        for record in manifest.records
    )
    motions = "a synthetic library" if manifest.synthetic else f"the library {words.library(manifest.library)}"
    text = (
        f"{counted(len(manifest.records), 'stimulus', 'stimuli')} from {motions}, {manifest.size[0]} × "
        f"{manifest.size[1]} pixels at {manifest.fps:g} frames per second."
    )
    if not manifest.videos:
        text += " There is no video of them in this folder, so nobody can have seen them."
    if extended:
        text += (
            f" In {'all' if extended == len(manifest.records) else extended} of them a motion was too short before or "
            "after the blend and was extended; the table says by how much."
        )
    return text


def versions(material: Material) -> tuple[tuple[str, str], ...]:
    """Return versions and hashes: of this program, of what made the stimuli, and of what was analysed."""
    import scipy

    table = hashlib.sha256(material.answers.to_csv(index=False).encode()).hexdigest()
    rows = [
        ("report by Segue", study.__version__),
        ("Python, NumPy, SciPy", f"{platform.python_version()}, {np.__version__}, {scipy.__version__}"),
        ("protocol", f"{material.protocol.name}, sha256 {material.protocol.sha256}"),
        ("answers analysed", f"sha256 {table}"),
    ]
    rows += [(f"stimuli: {name}", str(version)) for name, version in sorted(material.manifest.versions.items())]
    for column, label in (("segue_version", "sessions by Segue"), ("python_version", "sessions on Python")):
        if column in material.sessions:
            rows.append((label, ", ".join(sorted({str(value) for value in material.sessions[column].dropna()}))))
    return tuple(rows)
