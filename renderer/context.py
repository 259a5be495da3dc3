"""Offscreen OpenGL: finds a context that works on this machine, and says which.

The requested kind (or none) comes in; a `Context` goes out. Tried in this order:

1. `egl`: EGL with the system's libGL; a GPU where there is one, llvmpipe elsewhere;
2. `egl-only`: EGL that also supplies the GL functions, where libGL is missing;
3. `osmesa`: the system's OSMesa (Mesa before 25.1);
4. `osmesa-wheel`: OSMesa out of the Python package `lavavu-osmesa`, where the system has no GL at all.

Windows and macOS have none of these, and draw without a window by what moderngl finds there (WGL, CGL): `native`.

`SEGUE_GL` in the environment names one kind and rules out the others.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from renderer.errors import RendererError


def kinds_on(platform: str) -> tuple[str, ...]:
    """The kinds of contexts that a system (`sys.platform`) may have, in the order in which they are tried."""
    return ("native",) if platform in ("win32", "darwin") else ("egl", "egl-only", "osmesa", "osmesa-wheel")


KINDS = kinds_on(sys.platform)
REQUIRED_GL = 330

HOW_TO_INSTALL = (
    "install the driver of the graphics card"
    if KINDS == ("native",)
    else "install libegl1 and libgl1 (Debian, Ubuntu: apt install libegl1 libgl1; Fedora: dnf install mesa-libEGL "
    "mesa-libGL), or without root the Python package: pip install lavavu-osmesa"
)

_OSMESA_FORMAT, _OSMESA_RGBA = 0x22, 0x1908
_OSMESA_PROFILE, _OSMESA_CORE_PROFILE = 0x33, 0x34
_OSMESA_MAJOR, _OSMESA_MINOR = 0x36, 0x37
_GL_UNSIGNED_BYTE = 0x1401

# Software GL spends a thread a core on each process; the renderer runs a process a core instead. Must be set
# before the first context of the process. LP_NATIVE_VECTOR_WIDTH stays untouched: it changes pixels and crashes.
os_environ_defaults = {"LP_NUM_THREADS": "0"}


@dataclass(frozen=True, eq=False)
class Context:
    """An open OpenGL context.

    Parameters
    ----------
    kind
        One of `KINDS`.
    gl
        The `moderngl.Context`.
    version
        What GL says of its version, as `4.5 (Core Profile) Mesa 22.3.6`.
    renderer
        What draws, as `llvmpipe (LLVM 15.0.6, 256 bits)` or the GPU's name.
    """

    kind: str
    gl: Any
    version: str
    renderer: str

    @property
    def software(self) -> bool:
        """Whether the processor draws, not a GPU."""
        return any(name in self.renderer.lower() for name in ("llvmpipe", "softpipe", "swrast", "software"))

    def release(self) -> None:
        """Give the context back; it can't be drawn with afterwards."""
        self.gl.release()


def open_context(kind: str | None = None) -> Context:
    """Open an offscreen context of OpenGL 3.3 or later and make it current.

    Parameters
    ----------
    kind
        One of `KINDS`; by default `SEGUE_GL` of the environment, else the first that works.

    Raises
    ------
    RendererError
        Where none works; the message gives each reason and the packages that help.
    """
    wanted = kind or os.environ.get("SEGUE_GL") or None
    if wanted is not None and wanted not in KINDS:
        raise RendererError(f"Expected a context of kind {', '.join(KINDS)}, got {wanted!r}.")
    for name, value in os_environ_defaults.items():
        os.environ.setdefault(name, value)
    reasons: list[str] = []
    for each in [wanted] if wanted else KINDS:
        try:
            return _open(each)
        except Exception as reason:  # each library fails in its own way; all reasons are reported below
            reasons.append(f"{each}: {reason}")
    raise RendererError(f"No offscreen OpenGL 3.3 here; {HOW_TO_INSTALL}. Tried " + "; ".join(reasons) + ".")


_own = threading.local()


def shared_context(kind: str | None = None) -> Context:
    """The thread's own context of that kind, opened when first asked for, kept, and made current.

    A context is current in one thread at a time, so each thread has its own; and none outlives a fork.
    """
    key = (os.getpid(), kind or os.environ.get("SEGUE_GL") or None)
    contexts: dict[tuple[int, str | None], Context] = _own.__dict__.setdefault("contexts", {})
    if key not in contexts:
        contexts[key] = open_context(kind)
    context = contexts[key]
    context.gl.__enter__()
    return context


def describe() -> dict[str, Any]:
    """What is here to draw and encode with: `kind`, `gl_version`, `gl_renderer`, `software`, `h264`, `advice`.

    Nothing is raised: where something is missing, its value is None and `advice` (a list of sentences) says
    what to install.
    """
    found: dict[str, Any] = {"kind": None, "gl_version": None, "gl_renderer": None, "software": None}
    advice: list[str] = []
    try:
        context = open_context()
    except RendererError as error:
        advice.append(str(error))
    else:
        found |= {
            "kind": context.kind,
            "gl_version": context.version,
            "gl_renderer": context.renderer,
            "software": context.software,
        }
        context.release()
        if context.kind.startswith("osmesa"):
            advice.append(f"Drawn by OSMesa; the system's own GL can use a GPU: {HOW_TO_INSTALL.split(', or')[0]}.")
        elif context.software:
            advice.append("Drawn by the processor, which is fast enough; a GPU's driver with EGL would be used.")
    found["h264"] = _h264_encoder()
    if found["h264"] is None:
        advice.append("No libx264 in PyAV: install the wheel from PyPI (pip install --force-reinstall av).")
    return {**found, "advice": advice}


def _h264_encoder() -> str | None:
    try:
        import av

        av.codec.Codec("libx264", "w")
    except Exception:  # PyAV missing, or built without the encoder
        return None
    return f"libx264 (PyAV {av.__version__})"


def _open(kind: str) -> Context:
    import moderngl

    create: Any = moderngl.create_context  # its stub types every keyword as a dict
    if kind == "native":
        gl = create(standalone=True, require=REQUIRED_GL)
    elif kind == "egl":
        gl = create(standalone=True, backend="egl", require=REQUIRED_GL)
    elif kind == "egl-only":
        gl = create(standalone=True, backend="egl", libgl="libEGL.so.1", require=REQUIRED_GL)
    else:
        library = _system_osmesa() if kind == "osmesa" else _wheel_osmesa()
        gl = create(context=_OSMesaLoader(library), require=REQUIRED_GL)
    return Context(kind, gl, gl.info["GL_VERSION"], gl.info["GL_RENDERER"])


def _system_osmesa() -> ctypes.CDLL:
    name = ctypes.util.find_library("OSMesa") or "libOSMesa.so.8"
    return ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)


def _wheel_osmesa() -> ctypes.CDLL:
    """OSMesa from the files of `lavavu-osmesa`, which is not imported: it would start a viewer of its own."""
    try:
        files = metadata.files("lavavu-osmesa") or []
    except metadata.PackageNotFoundError:
        raise RendererError("the Python package lavavu-osmesa is not installed") from None
    libraries = [Path(str(f.locate())).resolve() for f in files if f.parts[0] == "lavavu_osmesa.libs"]
    osmesa = [path for path in libraries if path.name.startswith("libOSMesa")]
    if not osmesa:
        raise RendererError(f"lavavu-osmesa is installed without libOSMesa among its {len(libraries)} libraries")
    _preload([path for path in libraries if path not in osmesa])
    return ctypes.CDLL(str(osmesa[0]), mode=ctypes.RTLD_GLOBAL)


def _preload(libraries: list[Path]) -> None:
    """Load libraries that need one another, in whatever order works: one that fails waits for the others."""
    waiting = libraries
    while waiting:
        failed = []
        for path in waiting:
            try:
                ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
            except OSError:
                failed.append(path)
        if len(failed) == len(waiting):
            return  # OSMesa itself will say what it misses
        waiting = failed


class _OSMesaLoader:
    """An OSMesa context in the form that moderngl takes: finds functions, becomes current, goes away."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        create: Callable[..., int | None] = library.OSMesaCreateContextAttribs
        library.OSMesaCreateContextAttribs.restype = ctypes.c_void_p
        library.OSMesaCreateContextAttribs.argtypes = [ctypes.POINTER(ctypes.c_int), ctypes.c_void_p]
        library.OSMesaMakeCurrent.restype = ctypes.c_ubyte
        library.OSMesaMakeCurrent.argtypes = [
            ctypes.c_void_p,
            ctypes.c_void_p,
            ctypes.c_uint,
            ctypes.c_int,
            ctypes.c_int,
        ]
        library.OSMesaGetProcAddress.restype = ctypes.c_void_p
        library.OSMesaGetProcAddress.argtypes = [ctypes.c_char_p]
        library.OSMesaDestroyContext.argtypes = [ctypes.c_void_p]
        wanted = [_OSMESA_FORMAT, _OSMESA_RGBA, _OSMESA_PROFILE, _OSMESA_CORE_PROFILE]
        wanted += [_OSMESA_MAJOR, REQUIRED_GL // 100, _OSMESA_MINOR, REQUIRED_GL // 10 % 10, 0]
        self._context = create((ctypes.c_int * len(wanted))(*wanted), None)
        if not self._context:
            raise RendererError(f"OSMesa gave no OpenGL {REQUIRED_GL // 100}.{REQUIRED_GL // 10 % 10} core context")
        # OSMesa insists on a default framebuffer; nothing is ever drawn there.
        self._pixels = (ctypes.c_ubyte * (4 * 4 * 4))()
        self.__enter__()

    def load_opengl_function(self, name: str) -> int:
        return self._library.OSMesaGetProcAddress(name.encode()) or 0

    def __enter__(self) -> _OSMesaLoader:
        if not self._library.OSMesaMakeCurrent(self._context, self._pixels, _GL_UNSIGNED_BYTE, 4, 4):
            raise RendererError("OSMesa could not make its context current")
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the context current: moderngl enters another one when it needs it."""

    def release(self) -> None:
        if self._context:
            self._library.OSMesaDestroyContext(self._context)
            self._context = None
