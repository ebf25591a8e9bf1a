#!/usr/bin/python3
"""Every contact functor of YADE's package for spheres as a volume element: served, or refused with its reason.

    validation/contact_functors/run.py [ROW ...] [--list] [--record]

Rows: `own`, each law with the physics that it is for and its options; `derived`, each law with the physics that YADE's
dispatcher hands it besides. Exit status 1 if a scene ends the process, hangs, or is served and wrong without a word.
"""

import os
import sys
import tempfile
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"
HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

sys.path[:0] = [str(campaign.ROOT / "yade_scripts"), str(campaign.ROOT / "build" / "release"), str(campaign.ROOT / "tests" / "yade")]
import contact_functors

ROWS = {
    "own": "each law with the physics that it is for, and its options",
    "derived": "each law with derived physics, which YADE's dispatcher hands it as well",
}


def verify(c, names):
    text, lines, wrong = contact_functors.packing(), [], []
    own, without = contact_functors.own_scenes()
    scenes = {"own": own + contact_functors.options(), "derived": contact_functors.derived_scenes()}
    for name in names:
        outcomes = []
        for scene in scenes[name]:
            with tempfile.TemporaryDirectory() as folder:
                asked = {"script": contact_functors.script(scene, text)}
                found = c.value(f"{name}/{scene.slug}", asked, lambda: contact_functors.outcome(scene, text, folder))
            outcomes.append((scene, found))
            print(contact_functors.row(scene, found), flush=True)
        wrong += [scene.name for scene, found in outcomes if contact_functors.faults(found)]
        lines += [f"{name}: {ROWS[name]}.", "", *contact_functors.table(outcomes), ""]
    lines += ["Laws for other shapes:", "", *(f"* `{law}` {reason}" for law, reason in without.items())]
    c.table(lines)
    print("\n".join(f"FAULT: {name}" for name in wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    arguments = campaign.parser(HERE, __doc__, rows=True).parse_args()
    sys.exit(campaign.main(HERE, arguments, ROWS, lambda c: verify(c, arguments.rows or list(ROWS))))
