"""Beats and genres: hops that fit the music, and hops of the kind that is danced.

Koyama & Goto 2019, section 4.4 (beat-aware search: only offsets that put beats on beats) and section 5, Ease of
extension, Eq. 6 (a cost for hops of another genre). Beats come from an annotation, or are found in the motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from study.arrays import IntArray
from study.errors import TransitionError
from study.files import read_text
from study.motion.clip import Clip, joint_positions
from study.transitions.one_hop.problem import Distance

BEATS_PER_MINUTE = (70.0, 180.0)


def read_beats(path: Path, clip: Clip) -> IntArray:
    """The beats of a clip from a text file with a time in seconds first on each line, as frames of the clip.

    Further columns (the number of the beat in its bar) are not used, empty lines and lines with `#` are ignored, and
    so are times outside of the clip.
    """
    times = []
    for number, line in enumerate(read_text(path, "times of beats").splitlines(), start=1):
        words = line.split("#")[0].split()
        if not words:
            continue
        try:
            times.append(float(words[0]))
        except ValueError:
            raise TransitionError(f"{path}:{number}: expected a time in seconds, found {words[0]!r}.") from None
    return beats_at(times, clip)


def beats_at(times_s: Sequence[float], clip: Clip) -> IntArray:
    """Times in seconds from a clip's frame 0 as frames of the clip; those outside of it are ignored."""
    frames = np.unique(np.round(np.array(times_s) * clip.fps).astype(np.int64))
    return frames[(frames >= 0) & (frames < clip.frames)]


def regular_beats(clip: Clip, beats_per_minute: float, first_s: float = 0.0) -> IntArray:
    """The frames nearest to the beats of a steady tempo, from a first beat on."""
    if not (np.isfinite(beats_per_minute) and beats_per_minute > 0):
        raise TransitionError(f"Expected a tempo above 0 beats a minute, got {beats_per_minute}.")
    period = 60.0 / beats_per_minute
    times = np.arange(first_s % period, clip.seconds, period)
    frames = np.round(times * clip.fps).astype(np.int64)
    return frames[frames < clip.frames]


def find_beats(clip: Clip) -> IntArray:
    """The beats that a dance keeps to: the steady tempo and phase at which the body most comes to rest.

    Frames, ascending; `TransitionError` for a clip of less than two beats of the slowest tempo.

    Notes
    -----
    Dancers mark beats by stopping limbs: the mean speed of the joints about the root has minima there. The tempo whose
    Fourier component of that speed is largest is taken, and its minima are the beats. It finds the tempo of the
    motion, which may be half or twice that of the music.
    """
    slowest, fastest = BEATS_PER_MINUTE
    if clip.seconds < 2 * 60.0 / slowest:
        raise TransitionError(
            f"Expected at least two beats at {slowest:g} a minute ({2 * 60.0 / slowest:.1f} s) to find a tempo in, "
            f"{clip.name or 'the clip'} lasts {clip.seconds:.1f} s. Give its beats."
        )
    positions = joint_positions(clip)
    about_root = positions - positions[:, :1]
    speed = np.linalg.norm(np.gradient(about_root, axis=0), axis=-1).mean(axis=1)
    times = np.arange(clip.frames) / clip.fps
    trend = np.polynomial.Polynomial.fit(times, speed, 3)(times)
    # Fine enough that the phase at the ends is off by less than a twentieth of a beat.
    tempi = np.arange(slowest, fastest + 1e-9, min(1.0, 6.0 / clip.seconds))
    waves = np.exp(-2j * np.pi * np.outer(tempi / 60.0, times)) @ ((speed - trend) * np.hanning(clip.frames))
    best = int(np.argmax(np.abs(waves)))
    # cos(2 pi f t + angle) is least where its argument is pi.
    period = 60.0 / tempi[best]
    first = (np.pi - np.angle(waves[best])) / (2 * np.pi) * period
    return regular_beats(clip, float(tempi[best]), float(first))


def beat_offsets(source_beats: IntArray, hop_beats: IntArray, tolerance: int = 1) -> IntArray:
    """The offsets at which a hop's beats fall on the source's, ascending (section 4.4).

    From the frames of both clips' beats, every offset that puts a hop's beat on a beat of the source, and at which all
    other beats that fall between the source's first and last beat are on one, too; none at all where the tempi differ.
    Beats up to `tolerance` frames apart count as one.
    """
    source_beats, hop_beats = np.unique(source_beats), np.unique(hop_beats)
    if not len(source_beats) or not len(hop_beats):
        return np.zeros(0, dtype=np.int64)
    fitting = []
    for offset in np.unique(np.subtract.outer(source_beats, hop_beats)):
        shown = hop_beats + offset
        shown = shown[(shown >= source_beats[0] - tolerance) & (shown <= source_beats[-1] + tolerance)]
        after = np.clip(np.searchsorted(source_beats, shown), 1, max(len(source_beats) - 1, 1))
        nearest = np.minimum(
            np.abs(shown - source_beats[after - 1]),
            np.abs(shown - source_beats[np.minimum(after, len(source_beats) - 1)]),
        )
        if (nearest <= tolerance).all():
            fitting.append(int(offset))
    return np.array(fitting, dtype=np.int64)


def all_beat_offsets(
    beats: Mapping[int, IntArray], sources: Sequence[int], hops: Sequence[int]
) -> dict[tuple[int, int], IntArray]:
    """`Problem.offsets` for a beat-aware search, from the beats of each clip by its number.

    A clip without beats can't be a hop; a source without beats takes any.
    """
    return {
        (source, hop): beat_offsets(beats[source], beats.get(hop, np.zeros(0, dtype=np.int64)))
        for source in set(sources)
        for hop in set(hops)
        if source in beats
    }


def genre_costs(genres: Sequence[str], target: str, cost: float, distance: Distance) -> dict[int, int]:
    """`Problem.hop_costs` for a genre-aware search (Eq. 6).

    `genres` are those of the clips, `target` is the one to stay in, `cost` the `c` of Eq. 6, in the distance's cost.
    """
    if target not in genres:
        raise TransitionError(f"Expected one of the clips' genres ({', '.join(sorted(set(genres)))}), got {target!r}.")
    if not (np.isfinite(cost) and cost >= 0):
        raise TransitionError(f"Expected a cost of at least 0 for hops of another genre, got {cost}.")
    return {number: round(cost / distance.unit) for number, genre in enumerate(genres) if genre != target}
