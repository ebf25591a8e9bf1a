"""Ways in which a user's script ends its process: all of them end the script alone, and its scene is adopted as it is."""

import builtins
import os
import signal
import sys
import threading


class Left(BaseException):
    """Raised in the script, or in a hook of its engines, instead of the end of the process."""


def catch_exits(O):
    """Makes sys.exit, exit, quit, os._exit, os.abort, os.kill of oneself, signal.raise_signal, exec and YADE's
    O.exitNoBacktrace raise Left; returns what undoes it. A SystemExit that a hook raises itself is seen by Python's
    PyErr_Print, which then leaves the process but for an interpreter that inspects (bridge/engine.cpp)."""

    def leave(*args, **kwargs):
        raise Left

    def leave_politely(status=None):
        """As Python's own in the script, whose `except SystemExit` may want it; hooks run in a thread of YADE's."""
        raise SystemExit(status) if threading.current_thread() is threading.main_thread() else Left

    def kill(pid, number):
        if pid in (0, os.getpid()) and number != 0:
            raise Left
        return original_kill(pid, number)

    original_kill = os.kill
    polite = [(sys, "exit"), (builtins, "exit"), (builtins, "quit")]
    places = [(os, "_exit"), (os, "abort"), (signal, "raise_signal"), (type(O), "exitNoBacktrace")]
    places += [(os, name) for name in dir(os) if name.startswith("exec")]
    original = [(place, name, getattr(place, name, None)) for place, name in polite + places]
    for place, name in polite + places:
        setattr(place, name, leave_politely if (place, name) in polite else leave)
    os.kill = kill

    def undo():
        os.kill = original_kill
        for place, name, function in original:
            delattr(place, name) if function is None else setattr(place, name, function)

    return undo


def left(error):
    """Whether an error, or its last one in a hook, is an exit."""
    return isinstance(error, (Left, SystemExit)) or isinstance(getattr(sys, "last_value", None), (Left, SystemExit))
