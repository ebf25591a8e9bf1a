"""A dummy volume element that takes its time, and one whose constructor fails: for tests of the worker."""

import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "yade_scripts"))

import protocol


class SlowEngine(protocol.DummyEngine):
    """0.3 s for each deform."""

    def deform(self, ve, velocity_gradient, steps):
        time.sleep(0.3)
        super().deform(ve, velocity_gradient, steps)


class TemplateEngine(protocol.DummyEngine):
    """make_template does what the specification asks for."""

    def make_template(self, spec):
        if spec.get("script") == "crash":
            self._fault(0, "segv")
        if spec.get("script") == "endless":
            time.sleep(3600)
        if spec.get("script") == "mistake":
            raise ValueError("script theirs.py, line 3: no periodic cell; set O.periodic = True.")
        return super().make_template(spec)


class BrokenEngine:
    def __init__(self, report_fields):
        raise RuntimeError("YADE's modules were not found in /nowhere; set FEMXDEM_YADE_DIR.")
