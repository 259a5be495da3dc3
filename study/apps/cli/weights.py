"""`segue label` and `segue fit-weights`: transitions that people call good or bad, and the weights that follow."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.clips import as_is_option, clip_pair, clips_options, load_clip
from study.apps.cli.console import FILE, FPS, READABLE, emit, json_option, progress, say
from study.counting import counted, noun

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.transitions.candidates import Candidate
    from study.transitions.fit_weights import LabelledCut
    from study.transitions.labels import Label

ANSWERS = {"g": "good", "b": "bad", "s": "skip", "q": "quit"}


@click.command()
@click.argument("motions", nargs=-1, required=True, metavar="SRC DST [SRC DST]...")
@clips_options
@FPS
@click.option(
    "--best", type=click.IntRange(min=0), default=2, show_default=True, help="Number of the best cuts by each metric."
)
@click.option(
    "--worst", type=click.IntRange(min=0), default=1, show_default=True, help="Number of the worst cuts by each metric."
)
@click.option(
    "--random", "at_random", type=click.IntRange(min=0), default=2, show_default=True, help="Number of random cuts."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed, a whole number.")
@click.option("--strips", is_flag=True, help="Draw strips of poses (.png) instead of videos (.mp4).")
@click.option("--show", is_flag=True, help="Open each cut in the system's own viewer.")
@click.option(
    "--out",
    type=FILE,
    required=True,
    help="CSV file to append to; cuts that it has are not asked again. The cuts are drawn into a folder beside it.",
)
@json_option
def label(
    motions: tuple[str, ...],
    library: str | None,
    fps: float,
    seed: int,
    strips: bool,
    show: bool,
    out: Path,
    **counts: int,
) -> None:
    """Judge cuts between motions as good or bad (Wang & Bodenheimer 2003, section 3).

    The cuts are the best, worst and random ones by several metrics, unlabelled. `segue fit-weights` uses the
    judgements.
    """
    import numpy as np

    from study.transitions.candidates import candidates
    from study.transitions.labels import Label, append_label, read_labels

    if len(motions) % 2:
        raise click.UsageError(f"expected motions in pairs, SRC DST, found {len(motions)} of them.")
    known = {one.cut for one in read_labels(out)} if out.exists() else set()
    asked = {"good": 0, "bad": 0, "skip": 0}
    left = 0
    stopped = False
    for number, (source, destination) in enumerate(zip(motions[::2], motions[1::2], strict=True)):
        first, second = clip_pair(source, destination, library, fps)
        second = first if source == destination else second
        rng = np.random.default_rng([seed, number])
        found = candidates(first, second, rng, **counts)
        todo = [c for c in found if (source, destination, c.source_frame, c.destination_frame) not in known]
        for at, candidate in enumerate(todo):
            said = None if stopped else _ask(first, second, candidate, out, strips, show, f"{at + 1} of {len(todo)}")
            if said is None:
                stopped = True
                left += 1
                continue
            frames, where = (candidate.source_frame, candidate.destination_frame), library or "synthetic"
            append_label(out, Label(source, destination, *frames, said, fps, where, candidate.found))
            asked[said] += 1
    text = f"{out}: {asked['good']} good, {asked['bad']} bad, {asked['skip']} skipped"
    if left:
        text += f"; {left} {noun(left, 'is', 'are')} left: the same command resumes"
    emit({"file": str(out), **asked, "left": left, "known": len(known)}, text)


def _ask(
    source: Clip, destination: Clip, candidate: Candidate, out: Path, strips: bool, show: bool, place: str
) -> str | None:
    """Draw a cut and take the answer; None where the person stops."""
    picture = _drawn(source, destination, candidate, out.with_suffix(""), ".png" if strips else ".mp4")
    if show:
        click.launch(str(picture))
    say(f"{place}: {picture}")
    try:
        said = click.prompt(
            "good (g), bad (b), skip (s), quit (q)", type=click.Choice(list(ANSWERS)), show_choices=False, err=True
        )
    except click.Abort:
        return None
    return None if said == "q" else ANSWERS[said]


def _drawn(source: Clip, destination: Clip, candidate: Candidate, folder: Path, ending: str) -> Path:
    """Three seconds before and after the cut, or what there is, as 2003 showed them; drawn once."""
    from study.motion.clip import trim
    from study.motion.drawing import draw_clip
    from study.transitions.blending import cut

    frames = (candidate.source_frame, candidate.destination_frame)
    picture = folder / f"{source.name}-{frames[0]}-{destination.name}-{frames[1]}{ending}".replace("/", "_")
    if not picture.exists():
        made = cut(source, destination, *frames)
        around = round(3 * source.fps)
        start = max(0, made.blend_start - around)
        clip = trim(made.clip, start, min(made.clip.frames, made.blend_start + around))
        at = made.blend_start - start
        draw_clip(clip, picture, blended=(at, at))
    return picture


@click.command("fit-weights")
@click.argument("table", metavar="TRANSITIONS.csv", type=READABLE)
@click.option("--library", metavar="NAME|FOLDER", help="Library of the motions (default: that of the table).")
@as_is_option
@click.option(
    "--nu",
    type=click.FloatRange(min=0),
    default=1.0,
    show_default=True,
    help="Weight of velocities beside rotations, a factor.",
)
@click.option(
    "--transfer", nargs=2, metavar="SRC DST", help="A pair of motions without labels, to test with (default: none)."
)
@click.option("--no-cross-validation", is_flag=True, help="Fit only, without cross-validation.")
@json_option
def fit_weights(
    table: Path, library: str | None, nu: float, transfer: tuple[str, str] | None, no_cross_validation: bool
) -> None:
    """Joint weights from labelled transitions (Wang & Bodenheimer 2003, sections 3 and 4.1).

    The table has the columns source, destination, source_frame, destination_frame and label (good or bad), and may
    have fps and library, as `segue label` writes it.
    """
    from study.transitions.fit_weights import cross_validate
    from study.transitions.fit_weights import fit_weights as fit
    from study.transitions.labels import read_labels

    labels = [one for one in read_labels(table) if one.label != "skip"]
    rates = sorted({one.fps for one in labels})
    if len(rates) != 1:
        raise click.UsageError(
            f"expected labels at one frame rate in {table}, found {', '.join(f'{fps:g}' for fps in rates) or 'none'}."
        )
    cuts = _cuts(labels, library)
    found = fit(cuts, nu=nu)
    result: dict[str, Any] = {
        "weights": dict(found.weights),
        "scale": found.scale,
        "residual": found.residual,
        "good": found.good,
        "bad": found.bad,
        "nu": nu,
    }
    lines = [f"weights from {found.good} good and {found.bad} bad transitions, the largest one:"]
    lines += [f"  {role:12} {value:.4f}" for role, value in found.weights.items() if value > 0]
    lines.append("all other joints 0")
    if not no_cross_validation:
        pair = None if not transfer else clip_pair(*transfer, library or labels[0].library or None, rates[0])
        with progress("leave one out") as advance:
            checked = cross_validate(
                cuts, nu=nu, transfer=pair, progress=lambda done, of: advance(done / of, f"{done} of {of}")
            )
        result["cross_validation"] = {
            "mean_frames": checked.mean_frames,
            "median_frames": checked.median_frames,
            "deviations": checked.deviations,
        }
        lines.append(
            f"leaving one out moves the best transition by {checked.mean_frames:.2f} frames on average, median "
            f"{checked.median_frames:g}, most {max(checked.deviations)}"
        )
        if transfer:
            result["transfer"] = {"same": checked.transfer_same, "of": len(cuts), "deviations": checked.transfer}
            lines.append(
                f"from {transfer[0]} to {transfer[1]} it stays where it is in {checked.transfer_same} of {len(cuts)} "
                f"cases, and moves by {counted(max(checked.transfer), 'frame')} at most"
            )
    emit(result, "\n".join(lines))


def _cuts(labels: list[Label], library: str | None) -> list[LabelledCut]:
    """The labels with their clips, each clip read once and all on one skeleton."""
    from study.apps.cli.clips import on_body_of
    from study.transitions.fit_weights import LabelledCut

    clips: dict[tuple[str, str | None], Clip] = {}

    def clip(name: str, label: Label) -> Clip:
        key = (name, library or label.library or None)
        if key not in clips:
            read = load_clip(*key, label.fps)
            clips[key] = on_body_of(next(iter(clips.values())), read) if clips else read
        return clips[key]

    return [
        LabelledCut(clip(one.source, one), clip(one.destination, one), *one.cut[2:], float(one.label == "bad"))
        for one in labels
    ]
