"""Waiting for a run to make steps, so that what is done to it meets it at work."""

import time
from pathlib import Path


def steps_in(folder):
    """Whole rows of the history.csv of a run's folder."""
    file = Path(folder) / "history.csv"
    return max(0, file.read_text().count("\n") - 1) if file.exists() else 0


def wait_for_steps(process, folder, more, before=0):
    """Until a process (subprocess.Popen) that began with `before` rows in its folder has made `more`: those that an earlier
    run left there say nothing of this one, which may not even catch signals yet. AssertionError where it ends first."""
    while steps_in(folder) < before + more:
        assert process.poll() is None, f"the run ended with {steps_in(folder)} of {before + more} steps"
        time.sleep(0.002)
