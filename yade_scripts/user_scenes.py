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


def run_script(O, path, arguments, steps, seconds):
    """Runs `path` as `yade -n path arguments...` would, in __main__ (where YADE looks for the names of hooks).

    Windows are not opened: yade.qt is replaced by a module that answers to any name. A simulation left running in the
    background, or never started (left to a user's press on "play"), goes on until its own hooks pause it. The script is
    stopped where it is when its scene has made `steps` DEM steps, or, for want of steps, after `seconds` of wall time.
    Returns sentences on what was special. Raises ValueError when the script is missing, fails, or one of its hooks does.
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
    sys.last_value = None  # where Python leaves the error of a hook, which YADE only reports as one of its own
    restore = _limit_steps(O, steps)
    try:
        exec(compile(Path(path).read_text(), str(path), "exec"), names)
        if O.iter == 0 and O.engines:
            notes.append("the script did not start its simulation: run until its own hooks paused it")
            O.run()
        if O.running:
            O.wait()
    except _EnoughSteps:
        pass
    except _TimeUp:
        notes.append(f"the script's simulation was stopped after {seconds:g} s")
    except SystemExit:
        notes.append("the script called exit")
    except Exception as error:
        true = sys.last_value or error
        where = "failed in one of its hooks" if sys.last_value else "failed"
        raise ValueError(f've.script = "{path}" {where}: {type(true).__name__}: {true}') from error
    finally:
        clock.cancel()
        restore()
        while O.running:
            O.pause()
            time.sleep(0.05)
        os.chdir(here)
    if O.iter >= steps:
        notes.append(f"the script's simulation was stopped after {steps} steps")
    return notes


class _EnoughSteps(BaseException):
    """Raised in the script when its scene has made its steps."""


def _limit_steps(O, limit):
    """From now on run, wait and step of YADE's scene end at step number `limit`; returns what undoes it. The other scene,
    where yade.pack makes packings, has no limit."""
    Omega = type(O)
    original = {name: getattr(Omega, name) for name in ("run", "wait", "step", "switchScene")}
    in_other_scene = False

    def stop_at_limit():
        if O.iter >= limit and not O.running and not in_other_scene:
            raise _EnoughSteps

    def run(self, nSteps=-1, wait=False):
        stop_at_limit()
        if in_other_scene:
            return original["run"](self, nSteps, wait)
        left = limit - O.iter
        if nSteps <= 0 and O.stopAtIter > O.iter:
            nSteps = O.stopAtIter - O.iter
        original["run"](self, min(nSteps, left) if nSteps > 0 else left, wait)
        if wait:
            stop_at_limit()

    def wait(self):
        original["wait"](self)
        stop_at_limit()

    def step(self):
        stop_at_limit()
        original["step"](self)

    def switch_scene(self):
        nonlocal in_other_scene
        in_other_scene = not in_other_scene
        original["switchScene"](self)

    Omega.run, Omega.wait, Omega.step, Omega.switchScene = run, wait, step, switch_scene

    def undo():
        for name, function in original.items():
            setattr(Omega, name, function)

    return undo


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
