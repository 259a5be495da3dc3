"""How the server runs: what it asks of the system."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

# Four threads take memory at once; glibc then tells of how many heaps it came from.
HEAPS = """
import ctypes, sys, tempfile, threading
from study.apps.server import running

if sys.argv[1] == "shared":
    running._share_heap()
libc = ctypes.CDLL(None)
libc.malloc.restype = libc.fopen.restype = ctypes.c_void_p
libc.malloc.argtypes = [ctypes.c_size_t]
libc.malloc_info.argtypes, libc.fclose.argtypes = [ctypes.c_int, ctypes.c_void_p], [ctypes.c_void_p]
gate = threading.Barrier(5)


def take():
    libc.malloc(4000)
    gate.wait()


threads = [threading.Thread(target=take) for _ in range(4)]
for thread in threads:
    thread.start()
gate.wait()
for thread in threads:
    thread.join()
with tempfile.NamedTemporaryFile() as told:
    file = libc.fopen(told.name.encode(), b"w")
    libc.malloc_info(0, file)
    libc.fclose(file)
    print(open(told.name).read().count("<heap nr="))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc gives each thread a heap of its own")
def test_threads_share_one_heap() -> None:
    counts = {}
    for which in ("shared", "apart"):
        done = subprocess.run([sys.executable, "-c", HEAPS, which], capture_output=True, text=True, check=True)
        counts[which] = int(done.stdout)
    assert counts == {"shared": 1, "apart": 5}
