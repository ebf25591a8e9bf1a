#!/usr/bin/python3
"""Charts of speed against accuracy: the volume element, the point, the step, the mesh, the engine.

    validation/speed_accuracy/run.py [ve] [point] [step] [mesh] [engine] [presets] [--list] [--record] [--runs FOLDER] [--anew]

Each is one command of minutes on one core; all of them without a name. What is run: volume_elements.py, charts.py. The figure of the
four charts and the errors of the presets take the recorded numbers of charts that have not been run.
"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign
import charts
import presets
import volume_elements

ROWS = {"ve": "spheres, inertial number, time step of a single volume element", **{name: chart.text for name, chart in charts.CHARTS.items()},
        "presets": "ve.preset as it is: its errors in whole runs"}


def work(c, names):
    for name in names:
        if name in charts.CHARTS:
            charts.write(c, name)
    if "ve" in names:
        volume_elements.write_chart(c)
    if "presets" in names:
        presets.write(c)
    charts.draw(c)


if __name__ == "__main__":
    arguments = campaign.parser(HERE, __doc__, rows=True).parse_args()
    sys.exit(campaign.main(HERE, arguments, ROWS, lambda c: work(c, arguments.rows or list(ROWS))))
