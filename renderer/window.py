"""A window: draws figures and pictures live, times every flip, and hands over keys with their times.

Figures as positions `(frames, points, 3)` in metres and images as RGB come in; the times go out at which each was
presented, and events (keys, clicks, focus, size, asks to close), each with the time at which it arrived. All times are
glfw's: seconds of the machine's steady clock since the window was opened.

A flip is timed after the swap, once the pixels are done (`glFinish`). Where swaps wait for the display, they pace the
window. Virtual displays report a refresh rate of 0 and swaps there wait for nothing; a frame clock of our own takes
their place, and `Pacing.measured` is False: what reaches an eye, and when, is not known then.

The window is single-sampled: the capsules smooth their own edges, and multisampling costs a software renderer 10 ms a
frame.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from renderer.camera import Camera
from renderer.capsules import Figure
from renderer.errors import RendererError
from renderer.events import Click, CloseAsked, Event, Focus, Key, Resized, Size, Typed, key_name
from renderer.monitors import Monitor, find_monitors, monitor_of
from renderer.pacing import OWN_CLOCK_HZ, Pacing, find_pacing, next_flip
from renderer.screen import RGB, WHOLE, Drawing, Picture, Screen, Shares
from renderer.server_times import server_times
from renderer.xlib import when_server_is_lost

_TRIAL_SWAPS, _WARM_UP = 40, 10
_SPIN_S = 0.001

NO_DISPLAY = (
    "Expected a display to open a window on, found none that works ({reason}). Run it at the machine's own screen, "
    "name the display (DISPLAY or WAYLAND_DISPLAY), or use a virtual one (xvfb-run); `segue serve` needs no display."
)


class Window:
    """An open window; made by `open_window`, closed by `close` or `with`. Draw, then `flip`."""

    def __init__(self, handle: Any, gl: Any, full_screen: bool) -> None:
        import glfw

        self._glfw, self._handle, self.gl = glfw, handle, gl
        self.full_screen = full_screen
        self._events: list[Event] = []
        self._screen = Screen(gl)
        self._beat_s = float(glfw.get_time())
        self._server = server_times(glfw)
        self._zero_s = time.monotonic() - self.now()  # glfw counts the same clock there, from another zero
        self._listen()
        self.pacing = Pacing(OWN_CLOCK_HZ, 0.0, 0.0, own_clock=False)
        self._paced_by: Monitor | None = None
        self.settle((128, 128, 128))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # What it is

    @property
    def size(self) -> Size:
        """Width and height of what is drawn, pixels."""
        width, height = self._glfw.get_framebuffer_size(self._handle)
        return max(1, width), max(1, height)

    @property
    def scale(self) -> float:
        """How many pixels a unit of text takes: 1 on plain displays, 2 on dense ones."""
        return max(1.0, float(self._glfw.get_window_content_scale(self._handle)[1]))

    @property
    def focused(self) -> bool:
        """Whether keys come here."""
        return bool(self._glfw.get_window_attrib(self._handle, self._glfw.FOCUSED))

    @property
    def monitor(self) -> Monitor | None:
        """The monitor that shows most of the window; None while none is connected."""
        monitors = find_monitors(self._glfw)
        if not monitors:
            return None
        return monitor_of(monitors, self._glfw.get_window_pos(self._handle), self._glfw.get_window_size(self._handle))

    def settle(self, colour: RGB) -> bool:
        """Find the pacing by trial swaps of one colour, where the window has come to another monitor or mode.

        Returns whether it had; it takes up to a second then, and microseconds otherwise.
        """
        monitor = self.monitor
        if monitor is None or monitor == self._paced_by:
            return False
        self._paced_by = monitor
        self.pacing = replace(self.pacing, own_clock=False)  # swaps are to show what they wait for
        self.pacing = find_pacing(self._trial_swaps(colour), monitor.reported_hz)
        return True

    def describe(self) -> dict[str, Any]:
        """Display, rates, sizes and what draws, for the record of a session."""
        return {
            **({} if self._paced_by is None else self._paced_by.describe()),
            "full_screen": self.full_screen,
            "viewport": list(self.size),
            "content_scale": self.scale,
            "refresh_hz": round(self.pacing.refresh_hz, 4),
            "reported_hz": self.pacing.reported_hz,
            "swap_ms": round(self.pacing.swap_s * 1000, 3),
            "own_clock": self.pacing.own_clock,
            "timing_measured": self.pacing.measured,
            "key_times": "arrival" if self._server is None else "X server",
            "gl_renderer": self.gl.info["GL_RENDERER"],
            "gl_version": self.gl.info["GL_VERSION"],
            "glfw": _text(self._glfw.get_version_string()),
        }

    def when_lost(self, leave: Callable[[], None]) -> None:
        """Have a function called when the display is gone (X11); it has to end the process, which can show nothing."""
        if self._glfw.get_platform() == self._glfw.PLATFORM_X11:
            when_server_is_lost(leave)

    # Time

    def now(self) -> float:
        """Seconds of the window's clock."""
        return float(self._glfw.get_time())

    def next_flip_s(self) -> float:
        """When a flip that is asked for now will be presented, as far as one can tell."""
        return next_flip(self._beat_s, self.pacing.period_s, self.now())

    def flip(self) -> float:
        """Present what was drawn; returns when that was."""
        target_s = self.next_flip_s()
        if self.pacing.own_clock:
            self._wait_for(target_s)
        self._glfw.swap_buffers(self._handle)
        self.gl.finish()
        presented_s = self.now()
        self._beat_s = presented_s
        if self.pacing.own_clock:
            # Counted from when it was due, so that lateness does not add up.
            self._beat_s = target_s + self.pacing.period_s * ((presented_s - target_s) // self.pacing.period_s)
        return presented_s

    def _wait_for(self, moment_s: float) -> None:
        """Sleep for the most part, then watch the clock: sleeping alone may be a millisecond late."""
        left = moment_s - self.now()
        if left > _SPIN_S:
            time.sleep(left - _SPIN_S)
        while self.now() < moment_s:
            pass

    def _trial_swaps(self, colour: RGB) -> NDArray[np.float64]:
        """Times between swaps of an empty window, after some to warm up."""
        times = []
        for _ in range(_WARM_UP + _TRIAL_SWAPS):
            self.clear(colour)
            times.append(self.flip())
        return np.diff(times)[_WARM_UP:]

    # Drawing

    def picture(self, rgb: NDArray[np.uint8]) -> Picture:
        """Load an RGB picture `(height, width, 3)`; the first row is the top."""
        return self._screen.picture(rgb)

    def drawing(
        self,
        positions: NDArray[np.float64],
        figure: Figure,
        camera: Camera,
        fps: float,
        *,
        height: float = inf,
        cell: Shares = WHOLE,
    ) -> Drawing:
        """Lay out a motion `(frames, points, 3)` for this window, which takes a while; before the trial, that is.

        `height` is that of the picture in pixels; it is no larger than the window allows, or the part `cell` of it.
        """
        return self._screen.drawing(positions, figure, camera, fps, self.size, height, cell)

    def clear(self, colour: RGB) -> None:
        """Make the whole window one colour."""
        self._screen.clear(colour, self.size)

    def paint(self, picture: Picture, background: RGB) -> None:
        """Show a picture in the middle of the window, pixel for pixel."""
        self._screen.paint(picture, background, self.size)

    def paint_frame(self, drawing: Drawing, frame: int, *, over: bool = False) -> None:
        """Draw one frame of a motion on its figure's background, or `over` what is drawn already."""
        self._screen.paint_frame(drawing, frame, self.size, over=over)

    # What people do

    def poll(self) -> tuple[Event, ...]:
        """What happened since the last call."""
        self._receive()
        return self._taken()

    def wait(self, timeout_s: float | None = None) -> tuple[Event, ...]:
        """Sleep until something happens, or until the time is over; an event is timed as soon as it arrives."""
        if not self._events:
            if self._server is not None:
                self._server.wait(timeout_s if timeout_s is None else max(0.0, timeout_s))
            elif timeout_s is None:
                self._glfw.wait_events()
            elif timeout_s > 0:
                self._glfw.wait_events_timeout(timeout_s)
            self._receive()
        return self._taken()

    def _receive(self) -> None:
        if self._server is not None:
            self._server.read()
        self._glfw.poll_events()

    def cursor(self, visible: bool) -> None:
        """Show or hide the mouse pointer."""
        glfw = self._glfw
        glfw.set_input_mode(self._handle, glfw.CURSOR, glfw.CURSOR_NORMAL if visible else glfw.CURSOR_HIDDEN)

    def close(self) -> None:
        """Close the window and free what it holds."""
        if self._handle is None:
            return
        self._screen.release()
        self.gl.release()
        self._glfw.destroy_window(self._handle)
        self._glfw.terminate()
        self._handle = None

    def _taken(self) -> tuple[Event, ...]:
        taken, self._events = tuple(self._events), []
        return taken

    def _listen(self) -> None:
        """Have glfw hand over events; each takes its time first of all."""
        glfw, handle = self._glfw, self._handle

        def add(event: Event) -> None:
            self._events.append(event)

        def key(_: Any, token: int, scancode: int, action: int, modifiers: int) -> None:
            at = glfw.get_time()
            if self._server is not None and action != glfw.RELEASE:
                at = self._server.key(scancode, at + self._zero_s) - self._zero_s
            if action == glfw.PRESS and not modifiers & (glfw.MOD_CONTROL | glfw.MOD_ALT | glfw.MOD_SUPER):
                add(Key(key_name(token, glfw.get_key_name(token, scancode)), at))

        def button(_: Any, which: int, action: int, __: int) -> None:
            at = glfw.get_time()
            if which == glfw.MOUSE_BUTTON_LEFT and action == glfw.PRESS:
                if self._server is not None:
                    at = self._server.button(1, at + self._zero_s) - self._zero_s
                x, y = glfw.get_cursor_pos(handle)
                wide = max(1, glfw.get_window_size(handle)[0])
                ratio = self.size[0] / wide
                add(Click(x * ratio, y * ratio, at))

        def close(_: Any) -> None:
            at = glfw.get_time()
            glfw.set_window_should_close(handle, False)
            add(CloseAsked(at))

        glfw.set_key_callback(handle, key)
        glfw.set_char_callback(handle, lambda _, code: add(Typed(chr(code), glfw.get_time())))
        glfw.set_mouse_button_callback(handle, button)
        glfw.set_window_close_callback(handle, close)
        glfw.set_window_focus_callback(handle, lambda _, on: add(Focus(bool(on), glfw.get_time())))
        glfw.set_framebuffer_size_callback(handle, lambda _, w, h: add(Resized((w, h), glfw.get_time())))
        glfw.set_window_refresh_callback(handle, lambda _: add(Resized(self.size, glfw.get_time())))


def open_window(
    title: str = "Segue", *, full_screen: bool = True, size: Size = (1280, 800), monitor: int = 0
) -> Window:
    """Open a window of OpenGL 3.3 or later.

    Parameters
    ----------
    title
        For the window's frame.
    full_screen
        Take a whole monitor at its present mode; else a window that can be resized.
    size
        Of the window, where it is one.
    monitor
        Which monitor the full screen takes, counted from 0, the primary one.

    Raises
    ------
    RendererError
        Where there is no display, or none that draws OpenGL 3.3.
    """
    glfw = _load_glfw()
    if not glfw.init():
        raise RendererError(NO_DISPLAY.format(reason=_last_error(glfw)))
    try:
        screen = _monitor(glfw, monitor)
        full = glfw.get_video_mode(screen).size
        handle = _create(
            glfw, title, (full.width, full.height) if full_screen else size, screen if full_screen else None
        )
        glfw.make_context_current(handle)
        glfw.swap_interval(1)
        import moderngl

        create: Any = moderngl.create_context  # its stub types every keyword as a dict
        gl = create(require=330)
        glfw.show_window(handle)
        glfw.focus_window(handle)
        return Window(handle, gl, full_screen)
    except BaseException:
        glfw.terminate()
        raise


def check_display(monitor: int = 0) -> None:
    """Raise `RendererError` where no window can be opened for want of that monitor; costs milliseconds."""
    glfw = _load_glfw()
    if not glfw.init():
        raise RendererError(NO_DISPLAY.format(reason=_last_error(glfw)))
    try:
        _monitor(glfw, monitor)
    finally:
        glfw.terminate()


def _load_glfw() -> Any:
    try:
        import glfw
    except ImportError as error:
        raise RendererError(
            f"Expected the library glfw to open a window with, found none ({error}); install the Python package glfw."
        ) from error
    glfw.ERROR_REPORTING = "ignore"  # asked for with get_error, and reported in our own words
    return glfw


def _monitor(glfw: Any, number: int) -> Any:
    monitors = glfw.get_monitors()
    if not monitors:
        raise RendererError(NO_DISPLAY.format(reason="no monitor is connected"))
    if not 0 <= number < len(monitors):
        raise RendererError(f"Expected a monitor from 0 to {len(monitors) - 1}, got {number}.")
    return monitors[number]


def _create(glfw: Any, title: str, size: Size, monitor: Any) -> Any:
    """A window with a context: the system's own kind, else by EGL."""
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
    glfw.window_hint(glfw.SAMPLES, 0)
    glfw.window_hint(glfw.DEPTH_BITS, 0)
    glfw.window_hint(glfw.VISIBLE, False)
    # A full-screen window that loses the keyboard stays where it is: somebody else's click must not hide a study.
    glfw.window_hint(glfw.AUTO_ICONIFY, False)
    reasons = []
    for kind in (glfw.NATIVE_CONTEXT_API, glfw.EGL_CONTEXT_API):
        glfw.window_hint(glfw.CONTEXT_CREATION_API, kind)
        handle = glfw.create_window(*size, title, monitor, None)
        if handle:
            return handle
        reasons.append(_last_error(glfw))
    raise RendererError(
        f"Expected a display that draws OpenGL 3.3, found none ({'; '.join(reasons)}); install the graphics driver, "
        "or on Debian and Ubuntu libgl1-mesa-dri, which draws by the processor."
    )


def _last_error(glfw: Any) -> str:
    code, description = glfw.get_error()
    return _text(description) or f"glfw error {code}"


def _text(value: bytes | str | None) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else value or ""
