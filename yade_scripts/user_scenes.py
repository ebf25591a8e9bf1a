"""The doors for users' own volume elements: a saved scene, or a YADE script that runs unchanged."""

import ctypes
import os
import sys
import threading
import time
import types
from pathlib import Path


def load_scene(O, path):
    """Loads a saved scene (.yade.gz, .xml, .xml.bz2, .yade.bz2). Raises ValueError with the reason."""
    if not Path(path).is_file():
        raise ValueError(f've.scene = "{path}": no such file.')
    try:
        O.load(str(path))
    except Exception as error:
        raise ValueError(
            f've.scene = "{path}" cannot be loaded ({error}): YADE\'s archives are only good for the versions of YADE '
            "and Boost that wrote them; save the scene again with this one."
        ) from error


def run_script(O, path, arguments, seconds):
    """Runs `path` as `yade -n path arguments...` would, in __main__ (where YADE looks for the names of hooks).

    Windows are not opened: yade.qt is replaced by a module that answers to any name. A simulation left running in the
    background, or never started (left to a user's press on "play"), goes on until its own hooks pause it. After
    `seconds` of wall time the script is stopped where it is. Returns sentences on what was special.
    Raises ValueError when the script is missing or fails.
    """
    if not Path(path).is_file():
        raise ValueError(f've.script = "{path}": no such file.')
    os.environ["MPLBACKEND"] = "Agg"
    _without_windows()
    names = sys.modules["__main__"].__dict__
    names.update(_namespace(O), __file__=str(path))
    sys.argv = [str(path), *arguments]
    _prepare_runtime(sys.argv)
    notes = []
    clock = threading.Timer(seconds, _interrupt, (O, threading.get_ident()))
    clock.daemon = True
    clock.start()
    here = os.getcwd()
    sys.path.insert(0, str(Path(path).resolve().parent))
    try:
        exec(compile(Path(path).read_text(), str(path), "exec"), names)
        if O.iter == 0 and O.engines:
            notes.append("the script did not start its simulation: run until its own hooks paused it")
            O.run()
        if O.running:
            O.wait()
    except _TimeUp:
        notes.append(f"the script's simulation was stopped after {seconds:g} s")
    except SystemExit:
        notes.append("the script called exit")
    except Exception as error:
        raise ValueError(f've.script = "{path}" failed: {type(error).__name__}: {error}') from error
    finally:
        clock.cancel()
        while O.running:
            O.pause()
            time.sleep(0.05)
        os.chdir(here)
    return notes


class _TimeUp(BaseException):
    """Raised in the script when its time is over."""


def _interrupt(O, thread):
    """Makes `thread` leave a blocking O.run or O.wait and raise _TimeUp."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(_TimeUp))
    O.pause()


class _Nothing:
    """Answers to any name, call, index or assignment."""

    def __getattr__(self, name):
        return _Nothing()

    def __call__(self, *args, **kwargs):
        return _Nothing()

    def __getitem__(self, key):
        return _Nothing()

    def __setitem__(self, key, value):
        pass


def _without_windows():
    import yade

    qt = types.ModuleType("yade.qt")
    qt.__getattr__ = lambda name: _Nothing()
    sys.modules["yade.qt"] = qt
    yade.qt = qt


def _prepare_runtime(argv):
    """What the executable `yade` leaves in yade.runtime for scripts."""
    import yade.runtime

    yade.runtime.argv = list(argv)
    yade.runtime.hasDisplay = False
    yade.runtime.opts = types.SimpleNamespace(exitAfter=True, nogui=True, threads=1, mpi_mode=False)


def _namespace(O):
    """The names that the executable `yade` gives to a script."""
    import math

    import yade
    import yade.geom
    import yade.pack
    import yade.plot
    import yade.system
    import yade.utils

    names = {k: v for k, v in vars(math).items() if not k.startswith("_")}
    names.update(yade.system.cxxCtorsDict())
    for module in (yade.utils, yade.pack):
        names.update({k: v for k, v in vars(module).items() if not k.startswith("_")})
    names.update(O=O, yade=yade, utils=yade.utils, pack=yade.pack, geom=yade.geom, plot=yade.plot)
    return names
