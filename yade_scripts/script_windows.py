"""Windows of a user's script: every name of YADE's graphics is there and does nothing."""

import sys
import types

# What `from yade.qt import *` gives (YADE 2023.02a).
NAMES = (
    "View Controller Inspector Generator Renderer GLViewer SnapshotEngine SerializableEditor SeqSerializable controller "
    "ControllerClass ObjectInspector EngineInspector MaterialsInspector CellInspector BodyInspector "
    "SimulationInspector openUrl sslErrorHandler makeSerializableLabel QWidget QApplication QtCore QtGui Qt "
    "webWindows maxWebWindows views center activate close"
).split()


class Nothing:
    """Answers to any name, call, index, assignment or sum; it is empty, false and 0."""

    def __init__(self, *args, **kwargs):
        pass

    def __getattr__(self, name):
        if name.startswith("__") and name.endswith("__"):
            raise AttributeError(name)
        return Nothing()

    def __call__(self, *args, **kwargs):
        return Nothing()

    __getitem__ = __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __neg__ = __call__
    __enter__ = __call__

    def __setattr__(self, name, value):
        pass

    def __setitem__(self, key, value):
        pass

    def __iter__(self):
        return iter(())

    def __len__(self):
        return 0

    def __bool__(self):
        return False

    def __float__(self):
        return 0.0

    def __int__(self):
        return 0

    def __exit__(self, *args):
        return False


def close_windows():
    """Replaces yade.qt, and what lies below it, by modules of such names."""
    import yade
    import yade.wrapper

    qt = _module("yade.qt", {name: Nothing() for name in NAMES})
    qt.views = lambda: []
    qt.SnapshotEngine = yade.wrapper.SnapshotEngine
    qt.View = qt.Renderer = qt.center = qt.Controller = Nothing
    qt.__path__ = []
    yade.qt = qt
    for name in ("_GLViewer", "Inspector", "SerializableEditor", "ui_controller"):
        _module(f"yade.qt.{name}", {})
    yade._qt = _module("yade._qt", {})


def _module(name, values):
    module = types.ModuleType(name)
    module.__dict__.update(values, __all__=list(values), __getattr__=lambda asked: _asked(name, asked))
    sys.modules[name] = module
    return module


def _asked(module, name):
    if name.startswith("__"):
        raise AttributeError(f"module {module} has no attribute {name}")
    return Nothing()


def drop_nothings(O):
    """From now on O.engines takes lists with Nothing in them (engines of the graphics) and leaves it out. Returns what undoes
    it, with the count of what was left out as its attribute `dropped`."""
    Omega = type(O)
    engines = Omega.engines

    def undo():
        Omega.engines = engines

    def assign(self, given):
        real = [e for e in given if not isinstance(e, Nothing)]
        for engine in real:
            if type(engine).__name__ == "SnapshotEngine":
                engine.dead = True  # it wants a window
        undo.dropped += len(list(given)) - len(real)
        engines.__set__(self, real)

    undo.dropped = 0
    Omega.engines = property(engines.__get__, assign)
    return undo
