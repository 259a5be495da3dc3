"""The player's loop: a session (`study.experiment.session`) shown in a window, step by step.

A window, a protocol, a plan's session and a store come in; what the participant did goes to the store, each answer
before the next step. Which step comes next is the session's business alone, so that window, browser and simulation
show the same trials. The window is an argument: a scripted one takes its place in tests, clock included.

Reaction times run from the first flip of the last frame of the last stimulus; those of a further question from the flip
that put it up. While a question stands the player sleeps until something happens, so a key is timed when it arrives,
not at the next flip.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from renderer.events import Focus, Resized
from renderer.screen import WHOLE, Shares
from study.apps.player import screens
from study.apps.player.calm import calm, settled
from study.apps.player.desk import Desk, Stopped
from study.apps.player.pages import AGAIN, Look, cells_of
from study.apps.player.sheet import draw_page
from study.apps.player.showing import Showing, find_rate, frame_at, presentations
from study.experiment.picture_size import Sight, size_shown, wanted_px
from study.experiment.session import Session, advanced, answered, current, filled, missed, outcome, progress, restarted
from study.experiment.steps import Kind, Step
from study.experiment.stimuli.stimulus import Stimulus
from study.experiment.store.answers import Presentation
from study.tasks.registry import layout_of
from study.tasks.task import Layout

if TYPE_CHECKING:
    from renderer.window import Window
    from study.apps.player.store import ResponsesStore


@dataclass(frozen=True)
class Outcome:
    """How a session ended (`finished`, `stopped`, `declined`), the answers given in it, and flips that were dropped."""

    end: str
    answers: int
    dropped_flips: int
    faulty_trials: int


@dataclass(frozen=True)
class Setting:
    """How large pictures are shown: `actual_size` in the stimuli's own pixels, else as the protocol states.

    `screen_cm` is the width of the screen, by default as it says itself; `distance_cm` the viewing distance, by default
    the protocol's.
    """

    actual_size: bool = False
    screen_cm: float | None = None
    distance_cm: float | None = None


def play(
    window: Window,
    session: Session,
    stimulus: Callable[[str], Stimulus],
    store: ResponsesStore,
    look: Look,
    *,
    setting: Setting | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Walk a session to its end, or until the participant leaves.

    Parameters
    ----------
    window
        Where to show it.
    session
        As `session.open_session` gives it, with the answers that there are.
    stimulus
        Gives a stimulus by its id.
    store
        Takes answers and events; each is committed when the call returns.
    look
        Colours and font of the pages.
    setting
        The screen and the distance from which it is seen, as far as they are known.
    say
        Told in a few words of every answer that was stored.
    """
    with settled():
        return _Player(window, session, stimulus, store, look, setting or Setting(), say).run()


class _Player(Desk):
    """The state of the player: the session, and what was shown of the current trial."""

    def __init__(
        self,
        window: Window,
        session: Session,
        stimulus: Callable[[str], Stimulus],
        store: ResponsesStore,
        look: Look,
        setting: Setting,
        say: Callable[[str], None],
    ) -> None:
        super().__init__(window, session, store, look)
        self._stimulus, self._setting, self._say = stimulus, setting, say
        self._drawings: dict[tuple[str, Shares], Any] = {}
        self.plays = 0
        self._rate = find_rate(self.protocol.fps, window.pacing.refresh_hz)
        self._monitor = window.monitor
        self._answers = self._dropped = self._faulty = 0

    def run(self) -> Outcome:
        """Step after step."""
        self._check_pages()
        if not self._setting.actual_size:
            wanted_px(self.protocol.screen, self._sight())  # refuses now what can't be shown as stated
        self._note_display()
        end = "finished"
        try:
            if not any(step.kind == "consent" for step in self.session.steps):
                self.store.begin()
            while (step := current(self.session)).kind != "done":
                STEPS.get(step.kind, _Player._read)(self, step)
            self.store.event("finished")
            if (how := outcome(self.session)) != "finished":
                self.store.event(how)
            self.read_until(screens.last_page(self.protocol, self.protocol.texts.finished))
        except Stopped as stopped:
            end = stopped.end
        return Outcome(end, self._answers, self._dropped, self._faulty)

    def _note_display(self) -> None:
        """Write down what shows the session, and how its rate goes with that of the motions."""
        self._rate = rate = find_rate(self.protocol.fps, self.window.pacing.refresh_hz)
        if not rate.even:
            flips = f"{rate.shortest_flips} or {rate.longest_flips} flips of {self.window.pacing.refresh_hz:.4g} Hz"
            self._say(f"frames of {rate.fps:g} a second are shown for {flips}: not all equally long")
        self.store.event("display", {**self.window.describe(), **asdict(rate)})

    def _check_pages(self) -> None:
        """Refuse a text that is too long for this window now, not in mid-session."""
        read = {step.text: step for step in self.session.steps if step.text}
        for step in read.values():
            if step.kind == "consent":
                page = screens.consent_page(self.protocol, step)
            elif step.kind == "answer":
                page = screens.answer_page(self.protocol, step, (0, 1))
            else:
                page = screens.reading_page(self.protocol, step, (0, 1))
            draw_page(page, self.window.size, self.look, must_fit=True)

    def _read(self, step: Step) -> None:
        page = screens.reading_page(self.protocol, step, progress(self.session))
        while self.read_until(page) == "example":
            self._show([step.stimulus], [self._drawing(step.stimulus)])
            self._blank_for(0.3)
        self.session = advanced(self.session)

    def _consent(self, step: Step) -> None:
        if self.read_until(screens.consent_page(self.protocol, step)) == "decline":
            self.read_until(screens.last_page(self.protocol, self.protocol.consent.declined))
            raise Stopped("declined")
        self.store.begin()
        self.store.event("consent")
        self.session = advanced(self.session)

    # The form, one question at a time

    def _form(self, step: Step) -> None:
        fields, values, number = self.protocol.form_of(step.study), dict[str, str](), 0
        while number < len(fields):
            name = fields[number].name
            value = self.field(fields[number], step.text, values.get(name, ""), first=number == 0)
            if value is None:
                number -= 1
            else:
                values[name] = value
                number += 1
        self.session, taken = filled(self.session, values)
        self.store.form(taken, step.study)

    # A trial

    def _stimulus_step(self, step: Step) -> None:
        if step.slot == 1:
            self.showings, self.faults, self.plays = [], [], 0
            if self.window.settle(self.look.ground):
                self._note_display()
            self._monitor = self.window.monitor
            self._prepare(self.session)
            if not self.window.focused:
                self.read_until(screens.away_page(self.protocol))
                self._blank_for(0.3)
        LAYOUTS[layout_of(self.protocol.study(step.study))](self, step)

    def together(self, step: Step) -> None:
        """Show the stimuli of all slots at once, and go past all of them."""
        slots = [one for one in self.session.steps[self.session.position :] if (one.trial, one.attempt) ==
                 (step.trial, step.attempt) and one.slot]  # fmt: skip
        if not self._play_together([one.stimulus for one in slots]):
            self._start_again()
            return
        for _ in slots:
            self.session = advanced(self.session)

    def _play_together(self, identifiers: Sequence[str]) -> bool:
        """Play stimuli side by side, over the page that asks about them; whether nobody interrupted it."""
        drawings = [
            self._drawing(name, cell) for name, cell in zip(identifiers, cells_of(len(identifiers)), strict=True)
        ]
        found = self._show(list(identifiers), drawings)
        if found is None:
            return False
        self.plays += 1
        self.showings += found
        self.stills = [(drawing, drawing.frames - 1) for drawing in drawings]
        return True

    def in_turn(self, step: Step) -> None:
        """Show the stimulus of one slot by itself; the steps between two slots are gaps."""
        found = self._show([step.stimulus], [self._drawing(step.stimulus)])
        if found is None:
            self._start_again()
            return
        self.showings += found
        self.session = advanced(self.session)

    def _prepare(self, session: Session) -> None:
        """Lay out all that a trial shows, so that nothing has to be computed between its stimuli."""
        step, steps = current(session), session.steps[session.position :]
        own = [one for one in steps if (one.trial, one.attempt) == (step.trial, step.attempt)]
        wanted = [one.stimulus for one in own if one.stimulus]
        at_once = layout_of(self.protocol.study(step.study)) == "side by side"
        cells = cells_of(len(wanted)) if at_once else [WHOLE] * len(wanted)
        for key in [key for key in self._drawings if key not in set(zip(wanted, cells, strict=True))]:
            del self._drawings[key]
        for identifier, cell in zip(wanted, cells, strict=True):
            self._drawing(identifier, cell)
        asked = next(one for one in own if one.kind == "answer")
        self.drawn(screens.answer_page(self.protocol, asked, progress(session)))

    def _drawing(self, identifier: str, cell: Shares = WHOLE) -> Any:
        if (identifier, cell) not in self._drawings:
            one = self._stimulus(identifier)
            high = one.camera.size[1] if self._setting.actual_size else wanted_px(self.protocol.screen, self._sight())
            self._drawings[identifier, cell] = self.window.drawing(
                one.positions, one.figure, one.camera, self.protocol.fps, height=high, cell=cell
            )
        return self._drawings[identifier, cell]

    def _sight(self) -> Sight:
        """The screen that the window is on; its millimetres are what it says itself, unless somebody measured it."""
        known, setting = self.window.describe(), self._setting
        wide_px, high_px = known.get("display_pixels", self.window.size)
        wide_cm = setting.screen_cm or known.get("display_mm", (0, 0))[0] / 10
        distance_cm = setting.distance_cm or self.protocol.screen.distance_cm
        return Sight(high_px, wide_px / wide_cm if wide_cm else None, distance_cm)

    def _size_shown(self, identifier: str, cell: Shares) -> dict[str, Any]:
        """How large a stimulus is shown, for the record."""
        _, _, wide, high = self._drawing(identifier, cell).place
        return size_shown(wide, high, self._sight())

    def _show(self, identifiers: Sequence[str], drawings: Sequence[Any]) -> list[Showing] | None:
        """Play stimuli at once to the end of the longest; None where the participant interrupted it and stays.

        All are drawn in one flip, so that they are together to the frame; a shorter one stays at its last.
        """
        window, longest = self.window, max(drawing.frames for drawing in drawings)
        fps, period_s = self._rate.fps, window.pacing.period_s
        frames: list[int] = []
        flips: list[float] = []
        wrong = [] if window.focused else ["focus lost"]
        window.cursor(False)
        with calm():
            while True:
                onset_s = flips[0] if flips else window.next_flip_s()
                frame = frame_at(window.next_flip_s(), onset_s, fps, period_s) if flips else 0
                if frame >= longest:
                    break
                for number, drawing in enumerate(drawings):
                    window.paint_frame(drawing, min(frame, drawing.frames - 1), over=number > 0)
                flips.append(window.flip())
                frames.append(frame)
                events = window.poll()
                # A window that is merely to be drawn again, at its size, is: at the next flip.
                if any(isinstance(event, Resized) and event.size != self.size for event in events):
                    wrong.append("resized")
                if any(isinstance(event, Focus) and not event.focused for event in events):
                    wrong.append("focus lost")
                if self.notice(events):
                    self.ask_to_stop()
                    return None
        found = []
        for name, drawing in zip(identifiers, drawings, strict=True):
            own = sum(frame < drawing.frames for frame in frames)
            ended_s = flips[own] if own < len(flips) else None  # it then stood at its last frame
            shown = tuple(frames[:own]), tuple(flips[:own])
            found.append(Showing(name, fps, period_s, *shown, drawing.frames, ended_s, tuple(wrong)))
        self._dropped += found[0].dropped_flips
        return found

    def _start_again(self) -> None:
        """After an interruption the trial starts from its first stimulus; it has no answer yet."""
        step = current(self.session)
        self.store.event("trial begun again", {"trial": step.trial, "attempt": step.attempt, "step": step.place})
        self.session = restarted(self.session)

    def _blank(self, step: Step) -> None:
        """A gap or a pause: the empty ground for its time. The next trial is laid out while it lasts."""
        if not self._blank_for(step.duration_s or 0.0, prepare=step.kind == "pause") and step.kind == "gap":
            self._start_again()
        else:
            self.session = advanced(self.session)

    def _blank_for(self, duration_s: float, *, prepare: bool = False) -> bool:
        """Show nothing for a time; False where the participant interrupted it."""
        window = self.window
        window.cursor(False)
        window.clear(self.look.ground)
        end_s = self.flip_away() + duration_s - 0.5 * window.pacing.period_s
        if prepare:
            following = advanced(self.session)
            if current(following).slot == 1:
                self._prepare(following)
        while (left := end_s - window.now()) > 0:
            events = window.wait(left)
            if self.notice(events):
                self.ask_to_stop()
                return False
            if any(isinstance(event, Resized) for event in events):
                window.clear(self.look.ground)
                window.flip()
        return True

    def _answer(self, step: Step) -> None:
        """Ask, and store the answer with how its stimuli were shown before anything else."""
        page = screens.answer_page(self.protocol, step, progress(self.session))
        further = self.session.steps[self.session.position - 1].kind == "answer"
        while True:
            zero_s = max(showing.last_frame_s for showing in self.showings[-max(len(page.cells), 1) :])
            deadline_s = None if step.duration_s is None else zero_s + step.duration_s
            with calm():
                button, at, asked_s = self.ask(page, deadline_s)
            if button is None or button.name != AGAIN or self.standing is None:
                break
            self._play_together([showing.stimulus for showing in self.showings[: len(page.cells)]])
            page = screens.fewer_replays(self.protocol, step, self.standing, self.plays)
        if self.window.monitor != self._monitor:  # asked after the answer, since asking takes time
            self.fault("moved to another display")
        shown_well = not self.faults and all(showing.shown_well for showing in self.showings[: len(page.cells) or None])
        before = self.session
        if button is None:
            self.session, answer = missed(before, shown_well=shown_well)
        else:
            response_s = at - (asked_s if further else zero_s)
            self.session, answer = answered(before, button.name, response_s, shown_well=shown_well)
        self.store.answer(before.trial(step.trial), answer, () if further else self._presentations(step))
        self._answers += 1
        self._faulty += not shown_well
        which = f"trial {step.trial}" + (f" {step.item}" if step.item else "")
        badly = "" if shown_well else f"; display failure: {', '.join(self._reasons())}"
        self._say(f"{which}, showing {step.attempt}: answer stored{badly}")

    def _reasons(self) -> list[str]:
        reasons = [*self.faults, *(fault for showing in self.showings for fault in showing.faults)]
        worst = max(showing.longest_gap_frames for showing in self.showings)
        if not reasons:
            reasons.append(f"a frame was shown for {worst:.1f} frames")
        return list(dict.fromkeys(reasons))

    def _presentations(self, step: Step) -> list[Presentation]:
        at_once = len(self.stills) if self.plays else 0
        cells = cells_of(at_once) if at_once else [WHOLE] * len(self.showings)
        sizes = [self._size_shown(one.stimulus, cells[n % len(cells)]) for n, one in enumerate(self.showings)]
        method = "own clock" if self.window.pacing.own_clock else "swap"
        return presentations(step, self.showings, sizes, at_once, method, self.faults)


STEPS: Mapping[Kind, Callable[[_Player, Step], None]] = {
    "consent": _Player._consent,
    "form": _Player._form,
    "stimulus": _Player._stimulus_step,
    "gap": _Player._blank,
    "pause": _Player._blank,
    "answer": _Player._answer,
}
"""What is done at each kind of step; all others are read."""

LAYOUTS: Mapping[Layout, Callable[[_Player, Step], None]] = {
    "one after another": _Player.in_turn,
    "side by side": _Player.together,
}
"""How the slots of a trial are shown: from a slot's step on, past all that it showed."""
