"""The judge of an adopted scene: the scene itself, going on in YADE under the same strain."""

import os
import pickle
import sys

import numpy as np

import adoption
import archive_check
import contact_laws

FEW_STEPS = 10  # always compared
INERTIAL_NUMBER = 3e-4  # of the comparison: dashpots across the cell's boundary lag by the strain of a step in YADE


class Copy:
    """A forked process that holds YADE's scene as it is now, for a later question."""

    def __init__(self, answer):
        """answer(question) -> anything that can be pickled, in the copy. Raises OSError where fork is refused."""
        sys.stdout.flush()
        sys.stderr.flush()
        question, self._ask = os.pipe()
        self._answer, reply = os.pipe()
        self._child = os.fork()
        if self._child == 0:
            os.close(self._ask)
            os.close(self._answer)
            _serve(question, reply, answer)
        os.close(question)
        os.close(reply)

    def ask(self, question):
        """The answer, once. Raises RuntimeError with the copy's sentence, or when it died."""
        with os.fdopen(self._ask, "wb") as pipe:
            pickle.dump(question, pipe)
        with os.fdopen(self._answer, "rb") as pipe:
            said = pipe.read()
        os.waitpid(self._child, 0)
        if not said:
            raise RuntimeError("the scene's own continuation in YADE ended without an answer")
        answer, sentence = pickle.loads(said)
        if sentence:
            raise RuntimeError(sentence)
        return answer

    def dismiss(self):
        """Ends the copy without a question."""
        os.close(self._ask)
        os.close(self._answer)
        os.waitpid(self._child, 0)


def _serve(question, reply, answer):
    """The copy's life: one question, or none."""
    try:
        with os.fdopen(question, "rb") as pipe:
            asked = pipe.read()
        if asked:
            try:
                said = (answer(pickle.loads(asked)), None)
            except Exception as error:
                said = (None, f"the scene's own continuation in YADE failed: {type(error).__name__}: {error}")
            with os.fdopen(reply, "wb") as pipe:
                pickle.dump(said, pipe)
    finally:
        os._exit(0)


def own(O):
    """The Copy of a scene before adoption; its question: (time step, velocity gradient (3, 3), steps), in the
    scene's unit of time; its answer:
    {"as it was left": State, "at rest": State}, with and without the velocities of its grains."""
    return Copy(lambda question: _both(O, *question))


def _both(O, time_step, L, steps):
    left = Copy(lambda _: _go_on(O, time_step, L, steps, False))
    at_rest = _go_on(O, time_step, L, steps, True)
    return {"as it was left": left.ask(None), "at rest": at_rest}


def _go_on(O, time_step, L, steps, at_rest):
    """The scene's own engines but for those that strain, stop or record; gravity stays unless it is to be at rest."""
    from yade._utils import calm
    from yade.utils import Matrix3

    O.engines = [e for e in O.engines if not adoption.drives(O, e)]
    O.cell.velGrad = Matrix3.Zero
    O.stopAtIter, O.stopAtTime = 0, 0.0
    if at_rest:
        O.dt = contact_laws.resting_time_step(O)
        O.step()
        calm()
        O.cell.homoDeform = 2
    O.dt = time_step
    contact_laws.to_forces(O)
    O.cell.velGrad = Matrix3(*L.ravel())
    contact_laws.run(O, steps, contact_laws.adhesion_of_new_contacts(O))
    contact_laws.to_forces(O)
    return archive_check.state(O)


def strain_rate(time_scale, time_step):
    """Velocity gradient [1/s] of the comparison: plane compression along y, with half of it back along x."""
    direction = np.diag([0.5, -1.0, 0.0])
    rate = INERTIAL_NUMBER / time_scale if 0 < time_scale < np.inf else 1e-7 / time_step
    return rate * direction / np.linalg.norm(direction)


def report(own_states, adopted, steps, strain, settled):
    """The manifest's entry: how far the adopted State is from the scene's own ones, and a sentence where it is; none on the
    motion in which a packing of our own, `settled` within its tolerance, was left."""
    found = {name: archive_check.differences(theirs, adopted) for name, theirs in own_states.items()}
    entry = {"steps": steps, "strain": strain, "difference": found}
    notes = []
    worst = {name: max(values[k] for k in ("stress", "normal forces", "shear forces")) for name, values in found.items()}
    rest, left = found["at rest"], found["as it was left"]
    if worst["at rest"] > archive_check.TOLERANCE:
        notes.append(f"{steps} steps on, the volume element differs from the scene going on from rest in YADE: " + _listed(rest))
    if not settled and worst["as it was left"] > max(archive_check.TOLERANCE, 2 * worst["at rest"]):
        notes.append(
            f"the scene was left in motion, the volume element starts at rest: {steps} steps on, they differ: " + _listed(left)
        )
    return entry, notes


def _listed(values):
    return ", ".join(f"{what} {size:.1e}" if what != "contacts" else f"{size} contacts" for what, size in values.items())
