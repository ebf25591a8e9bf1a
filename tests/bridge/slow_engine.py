"""Dummy volume elements that take their time, cannot fork, or do not start: for tests of the worker."""

import os
import resource
import signal
import time

from dummy_engine import DummyEngine


class SlowEngine(DummyEngine):
    """0.3 s for each deform."""

    def deform(self, ve, velocity_gradient, steps):
        time.sleep(0.3)
        super().deform(ve, velocity_gradient, steps)


class TemplateEngine(DummyEngine):
    """make_template does what the specification asks for."""

    def make_template(self, spec):
        if spec.get("script") == "crash":
            self._fault(0, "segv")
        if spec.get("script") == "alarm":
            os.kill(os.getpid(), signal.SIGALRM)
        if spec.get("script") == "endless":
            time.sleep(3600)
        if spec.get("script") == "mistake":
            raise ValueError("script theirs.py, line 3: no periodic cell; set O.periodic = True.")
        return super().make_template(spec)


class UnforkableEngine(DummyEngine):
    """In a process that may start no other (limits do not bind root)."""

    def __init__(self, report_fields):
        super().__init__(report_fields)
        if os.getuid() == 0:
            os.setuid(65534)
        resource.setrlimit(resource.RLIMIT_NPROC, (0, 0))


class BrokenEngine:
    def __init__(self, report_fields):
        raise RuntimeError("YADE's modules were not found in /nowhere; set FEMXDEM_YADE_DIR.")
