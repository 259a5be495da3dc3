"""The server's memory: one heap for all threads, and handed back when it is free."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

# Four threads take memory at once; glibc then tells of how many heaps it came from.
HEAPS = """
import ctypes, sys, tempfile, threading
from study.apps.server import memory

if sys.argv[1] == "shared":
    memory.set_up()
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


# Objects that know each other, as a closed connection and its protocol do, among others that stay.
CYCLES = """
import sys
from study.apps.server import memory


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1])


class Node:
    pass


def closed():
    node = Node()
    node.other, node.read = Node(), bytes(2000)
    node.other.other = node


memory.set_up()
before = resident()
for _ in range(20_000):
    closed()
held = resident() - before
if sys.argv[1] == "handed back":
    memory.hand_back()
print(4096 * held, 4096 * (resident() - before))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc is asked to give memory back")
def test_memory_that_only_cycles_hold_goes_back_to_the_system() -> None:
    kept = {}
    for which in ("handed back", "as it is"):
        done = subprocess.run([sys.executable, "-c", CYCLES, which], capture_output=True, text=True, check=True)
        held, after = map(int, done.stdout.split())
        assert held > 30e6
        kept[which] = after / held
    assert kept["handed back"] < 0.2
    assert kept["as it is"] > 0.9
