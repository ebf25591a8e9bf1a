"""The doors for users' own volume elements: a saved scene, or a YADE script that runs unchanged."""

import ctypes
import hashlib
import os
import signal
import sys
import tempfile
import threading
import time
import types
from pathlib import Path

from script_exits import Left, catch_exits, left
from script_inputs import recorded
from script_limits import Limits, cut_off_network
from script_windows import close_windows, drop_nothings

GRACE = 20  #: [s] for a script to end after its time; bridge/python_volume_elements.cpp has its sentence


def load_scene(O, path, sha256):
    """Loads a saved scene (.yade.gz, .xml, .xml.bz2, .yade.bz2) whose file has that SHA-256, or any where it is "any": what reads
    an archive trusts its author. Raises ValueError with the reason."""
    if not Path(path).is_file():
        raise ValueError(f've.scene = "{path}": no such file.')
    own = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    if not sha256:
        raise ValueError(
            f've.scene = "{path}" is an archive, which may do what its author likes; if you trust it write ve.scene_sha256 = "{own}".'
        )
    if sha256.lower() not in ("any", own):
        raise ValueError(f've.scene = "{path}" is not the file of ve.scene_sha256, its own is {own}; get it again, or correct the case.')
    try:
        O.load(str(path))
    except Exception as error:
        raise ValueError(
            f've.scene = "{path}" cannot be loaded ({error}): YADE\'s archives are only good for the versions of YADE '
            "and Boost that wrote them; save the scene again with this one."
        ) from error


def run_script(O, path, arguments, steps, seconds, memory, output):
    """Runs `path` as `yade -n path arguments...` would, in __main__ (where YADE looks for the names of hooks).

    Windows are not opened: yade.qt is replaced by a module that answers to any name. A simulation left running in the
    background, or never started (left to a user's press on "play"), goes on until its own hooks pause it. The script is
    stopped where it is when its scene has made `steps` DEM steps, or, for want of steps, after `seconds` of wall time; it may
    end its process in whatever way: the scene is then what it is at that moment. A call that cannot be interrupted is ended
    with the process, by SIGALRM, GRACE later. `memory` [GB] and `output` [MB]: see script_limits.py.
    Returns (sentences on what was special, {file that it read: hash}). Raises ValueError when the script is missing, fails, or
    one of its hooks does.
    """
    if not Path(path).is_file():
        raise ValueError(f've.script = "{path}": no such file.')
    names = _main_module(O, path, arguments)
    here, notes, run_calls, graphics = os.getcwd(), [], [], drop_nothings(O)
    undo = [_limit_steps(O, steps, run_calls), catch_exits(O), graphics]
    if not cut_off_network():
        notes.append("the script could reach the network: this system does not let it be cut off")
    with recorded(O, path) as recorder, Limits(memory, output) as limits:
        try:
            _run_it(O, path, names, run_calls, seconds, notes)
        finally:
            while O.running:
                O.pause()
                time.sleep(0.05)
            for back in undo:
                back()
            os.chdir(here)
    if limits.said_too_much():
        notes.append(f"what the script printed after {output:g} MB was left out")
    if graphics.dropped:
        notes.append(f"{graphics.dropped} engines of the graphics were left out")
    if recorder.programs:
        notes.append(f"the script started {recorder.programs[0]}: what other programs read is not followed")
    if O.iter >= steps:
        notes.append(f"the script's simulation was stopped after {steps} steps")
    return notes, recorder.inputs


def _main_module(O, path, arguments):
    """Makes __main__, its arguments and its surroundings what `yade -n path arguments...` has; the names of __main__."""
    os.environ["MPLBACKEND"] = "Agg"
    os.environ.setdefault("HOME", tempfile.gettempdir())  # yade.plot and Matplotlib look for it
    close_windows()
    names = sys.modules["__main__"].__dict__
    names.update(_namespace(O), __file__=str(path))
    sys.argv = [str(path), *arguments]
    _prepare_runtime(sys.argv)
    sys.path.insert(0, str(Path(path).resolve().parent))
    sys.last_value = None  # where Python leaves the error of a hook, which YADE only reports as one of its own
    return names


def _run_it(O, path, names, run_calls, seconds, notes):
    """Runs the script, and its simulation where that goes on or has never begun; adds to `notes` what was special."""
    clock = threading.Timer(seconds, _interrupt, (O, threading.get_ident()))
    clock.daemon = True
    clock.start()
    woken = signal.signal(signal.SIGUSR2, lambda *_: None)  # out of a sleep, or a wait for what the script has started
    signal.setitimer(signal.ITIMER_REAL, seconds + GRACE)
    try:
        exec(compile(Path(path).read_bytes(), str(path), "exec"), names)
        if O.iter == 0 and not run_calls and O.engines:
            notes.append("the script did not start its simulation: run until its own hooks paused it")
            O.run()
        if O.running:
            O.wait()
    except _EnoughSteps:
        pass
    except _TimeUp:
        if O.iter == 0:
            raise ValueError(
                f've.script = "{path}" made no DEM step in ve.script_seconds = {seconds:g} s; let its simulation run, or give it more time.'
            ) from None
        notes.append(f"the script's simulation was stopped after {seconds:g} s")
    except (Exception, KeyboardInterrupt, SystemExit, Left) as error:
        if not left(error):
            raise _failure(path, error) from error
        in_hook = not isinstance(error, (Left, SystemExit))
        notes.append("the script called exit" + (" in one of its hooks: adopted as it was then" if in_hook else ""))
    finally:
        clock.cancel()
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGUSR2, woken)


def _failure(path, error):
    """The sentence on a script that failed: the error of a hook is the true one, YADE only reports it as one of its own."""
    true = sys.last_value or error
    where = "failed in one of its hooks" if sys.last_value else "failed"
    return ValueError(f've.script = "{path}" {where}: {type(true).__name__}: {true}')


class _EnoughSteps(BaseException):
    """Raised in the script when its scene has made its steps."""


def _limit_steps(O, limit, run_calls):
    """From now on run, wait and step of YADE's scene end at step number `limit`; returns what undoes it. The other scene,
    where yade.pack makes packings, has no limit. Calls of run and step are noted in `run_calls`."""
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
        run_calls.append("run")
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
        if not in_other_scene:
            run_calls.append("step")
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
    signal.pthread_kill(thread, signal.SIGUSR2)


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
