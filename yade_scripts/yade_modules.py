"""Finds and loads YADE's Python modules in a plain interpreter: the only place that knows where they are."""

import os
import sys
from contextlib import contextmanager
from pathlib import Path

DEFAULT_DIR = "/usr/lib/x86_64-linux-gnu/yade-double/py"
PYTHON_VERSION = (3, 11)  # the interpreter Debian 12 builds that YADE for


def load():
    """YADE's scene object `O`, with `yade.utils` and `yade._utils` imported.

    The folder is the environment's FEMXDEM_YADE_DIR, else Debian's. One OpenMP thread: fastest below some 2000 spheres,
    and deterministic. MPI's variables are removed, or YADE would start an MPI of its own.
    Raises RuntimeError on another interpreter or a missing folder.
    """
    folder = Path(os.environ.get("FEMXDEM_YADE_DIR") or DEFAULT_DIR)
    if str(folder) == DEFAULT_DIR and sys.version_info[:2] != PYTHON_VERSION:
        raise RuntimeError(
            f"Debian's YADE is built for Python {PYTHON_VERSION[0]}.{PYTHON_VERSION[1]}, but this is {sys.executable} "
            f"{sys.version.split()[0]}: use /usr/bin/python3 (CMake: -DFEMXDEM_PYTHON=/usr/bin/python3)."
        )
    if not (folder / "yade" / "__init__.py").is_file():
        raise RuntimeError(
            f"No YADE in {folder}: install Debian's package python3-yade, or set FEMXDEM_YADE_DIR to the folder that "
            "holds the Python package `yade`."
        )
    os.environ["OMP_NUM_THREADS"] = "1"
    for name in [n for n in os.environ if n.startswith(("OMPI_", "PMIX_"))]:
        del os.environ[name]
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    with _silence():
        import yade  # registers the C++ classes

        import yade._utils
        import yade.utils
        import yade.wrapper

    return yade.wrapper.Omega()


@contextmanager
def _silence():
    """YADE's import writes to the standard output, past Python: every worker would say it."""
    sys.stdout.flush()
    out = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
        sys.stdout.flush()
    finally:
        os.dup2(out, 1)
        os.close(out)
        os.close(nowhere)


def versions():
    """Versions of what the volume elements depend on; saved states are only good for equal ones."""
    import numpy
    import yade.config

    return {
        "yade": yade.config.version,
        "python": sys.version.split()[0],
        "numpy": numpy.__version__,
    }
