"""Faults within YADE's volume elements, for ../run.py: with this folder on PYTHONPATH the worker's Python loads it by itself.

FAULT_VE = "KIND CALL FILE": at the call number CALL of Engine.deform in a process, counted through its forks, once and for
all: FILE is made when it strikes, and no fault strikes while FILE is there. "always" in the place of FILE: each time. KIND:
raise, hang (asleep), loop (busy), nan, segv, kill, exit, memory (until none is left), print (100 MB).
"""

import os
import signal
import sys
import time


def strike(kind):
    if kind == "raise":
        raise ZeroDivisionError("a fault of this campaign")
    if kind == "hang":
        time.sleep(3600)
    if kind == "loop":
        while True:
            pass
    if kind == "exit":
        os._exit(0)
    if kind in ("segv", "kill"):
        os.kill(os.getpid(), {"segv": signal.SIGSEGV, "kill": signal.SIGKILL}[kind])
    if kind == "memory":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (1 << 33, 1 << 33))
        held = []
        while True:
            held.append(bytearray(1 << 28))
            held[-1] = memoryview(held[-1])[:1]  # mapped, not touched
    if kind == "print":
        for _ in range(100):
            print("x" * 1_000_000)


class Importer:
    """Finds volume_element as the next finder does, and wraps its Engine."""

    def find_spec(self, name, path=None, target=None):
        if name != "volume_element":
            return None
        sys.meta_path.remove(self)
        import importlib.util

        spec = importlib.util.find_spec(name)
        load = spec.loader.exec_module

        def exec_module(module):
            load(module)
            wrap(module.Engine)

        spec.loader.exec_module = exec_module
        return spec


def wrap(Engine):
    kind, at, mark = os.environ["FAULT_VE"].split(" ", 2)
    deform, measure = Engine.deform, Engine.measure
    calls, poisoned = 0, False

    def strikes():
        if calls != int(at) and mark != "always" or calls < int(at):
            return False
        if mark == "always":
            return True
        try:
            os.close(os.open(mark, os.O_CREAT | os.O_EXCL))
            return True
        except FileExistsError:
            return False

    def deform_(self, ve, *rest, **more):
        nonlocal calls, poisoned
        calls += 1
        now = strikes()
        poisoned = now and kind == "nan"
        if now and kind != "nan":
            strike(kind)
        return deform(self, ve, *rest, **more)

    def measure_(self, ve, out_stress, *rest):
        nonlocal poisoned
        measure(self, ve, out_stress, *rest)
        if poisoned:
            out_stress[:] = float("nan")
        poisoned = False

    Engine.deform, Engine.measure = deform_, measure_


if "FAULT_VE" in os.environ and os.path.basename(os.readlink("/proc/self/exe")) == "femxdem-worker":
    sys.meta_path.insert(0, Importer())
