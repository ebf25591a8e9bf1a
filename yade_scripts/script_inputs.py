"""The files that a user's script reads: a packing of the cache is good only as long as they are what they were.

Python tells of every file that it opens (an audit hook, before the file is opened) and of the modules that it has
loaded; files that YADE itself opens are seen at its methods. What the system installed is left out: versions are in the
cache's key. Names are kept as the script gave them, so that a relative one is looked for where the program runs.
"""

import os
import sys
import zlib
from contextlib import contextmanager

SYSTEM = ("/usr/lib/", "/usr/share/", "/usr/bin/", "/usr/local/lib/", "/lib/", "/etc/", "/proc/", "/sys/", "/dev/", "/var/")
MISSING = "missing"

_recorder = None  # of the script that runs now: an audit hook cannot be taken away again
_hooked = False


class Recorder:
    """inputs {name: hash} of files read, in the order of their first opening, and the programs that the script started."""

    def __init__(self, script, own_folder):
        self.inputs, self.programs = {}, []
        self._written = set()
        self._ignored = (os.path.abspath(script), own_folder + os.sep)
        self._home = os.getcwd()
        self._busy = False
        self._before = set(sys.modules)

    def opened(self, name, mode, flags):
        """A file is about to be opened."""
        if self._busy or isinstance(name, int) or not name:
            return
        self._busy = True
        try:
            path = os.path.abspath(os.fsdecode(name))
            if os.path.isdir(path) or self._is_left_out(path):
                return
            if _writes(mode, flags) and path not in self.inputs:
                self._written.add(path)
            if path not in self._written:
                self._add(os.fsdecode(name), path)
        finally:
            self._busy = False

    def modules(self):
        """Adds the modules that were loaded since; forgets them, so that the next script loads them anew."""
        for name in set(sys.modules) - self._before:
            source = getattr(sys.modules[name], "__file__", None)
            if not isinstance(source, str) or self._is_left_out(os.path.abspath(source)):
                continue
            self._add(source, os.path.abspath(source))
            if source.endswith(".py"):
                del sys.modules[name]

    def _is_left_out(self, path):
        return path.startswith(SYSTEM) or path.startswith(self._ignored) or "__pycache__" in path

    def _add(self, name, path):
        at_home = os.path.abspath(os.path.join(self._home, name)) == path
        self.inputs.setdefault(name if at_home else path, hash_of(path))


def _writes(mode, flags):
    if isinstance(mode, str):
        return any(c in mode for c in "wxa") and "r" not in mode
    return bool(flags & (os.O_WRONLY | os.O_TRUNC)) if isinstance(flags, int) else False


def hash_of(path):
    """"SIZE-CRC32" of a file's bytes (CRC-32 of ISO 3309, hexadecimal); MISSING where there is none.
    bridge/script_inputs.cpp finds the same."""
    size, crc = 0, 0
    try:
        with open(path, "rb") as file:
            while block := file.read(1 << 20):
                size, crc = size + len(block), zlib.crc32(block, crc)
    except OSError:
        return MISSING
    return f"{size}-{crc:08x}"


@contextmanager
def recorded(O, script):
    """Records what is read within; yields the Recorder, whose `modules` are taken at the end."""
    global _recorder
    _hook()
    recorder = Recorder(script, os.path.dirname(os.path.abspath(__file__)))
    undo = _watch_yade(O, recorder)
    bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    _recorder = recorder
    try:
        yield recorder
    finally:
        _recorder = None
        sys.dont_write_bytecode = bytecode
        undo()
        recorder.modules()


def _hook():
    global _hooked
    if not _hooked:
        sys.addaudithook(_audit)
        _hooked = True


def _audit(event, arguments):
    if _recorder is None:
        return
    if event == "open":
        _recorder.opened(*arguments)
    elif event in ("subprocess.Popen", "os.system", "os.posix_spawn") and not _recorder._busy:
        _recorder.programs.append(str(arguments[0]))


def _watch_yade(O, recorder):
    """YADE's own readers of files tell the recorder; returns what undoes it."""
    from yade._packSpheres import SpherePack

    original = [(kind, name, getattr(kind, name)) for kind in (type(O), SpherePack) for name in ("load", "save")]

    def watched(function, mode):
        def call(self, file, *args, **kwargs):
            recorder.opened(file, mode, 0)
            return function(self, file, *args, **kwargs)

        return call

    for kind, name, function in original:
        setattr(kind, name, watched(function, "r" if name == "load" else "w"))

    def undo():
        for kind, name, function in original:
            setattr(kind, name, function)

    return undo
