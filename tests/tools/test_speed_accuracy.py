"""The fronts of validation/speed_accuracy, and that its presets have the errors of its charts."""

import sys
import types
import unittest
from pathlib import Path

PAGE = Path(__file__).parents[2] / "validation" / "speed_accuracy"
sys.path[:0] = [str(PAGE), str(PAGE.parent / "tools")]
import charts
import presets


def row(cost, error):
    return {"cost": cost, "error": error}


class Front(unittest.TestCase):
    def test_keeps_what_nothing_is_both_cheaper_and_better_than(self):
        cheap, good, worse, as_dear = row(1, 0.3), row(3, 0.1), row(2, 0.4), row(3, 0.2)
        self.assertEqual(charts.front([worse, good, cheap, as_dear], "cost", "error"), [good, cheap])

    def test_does_not_tell_apart_what_is_within_the_references_own_error(self):
        cheap, dear = row(1, 0.02), row(9, 0.001)
        self.assertEqual(charts.front([cheap, dear], "cost", "error"), [cheap, dear])
        self.assertEqual(charts.front([cheap, dear], "cost", "error", floor=0.03), [cheap])


class Settings(unittest.TestCase):
    def test_charts_have_their_references_and_each_name_once(self):
        for name, chart in charts.CHARTS.items():
            keys = [(s.material, s.name) for s in chart.settings]
            self.assertEqual(len(keys), len(set(keys)), name)
            for material, names in chart.references.items():
                self.assertTrue({(material, n) for n in names} <= set(keys), name)

    def test_presets_have_the_errors_of_the_recorded_charts(self):
        page = (PAGE / "README.md").read_text()
        c = types.SimpleNamespace(runs=PAGE / "nowhere", home=PAGE)
        lines = presets.table(c, charts.recorded(c, "presets"))
        self.assertEqual(len(lines), 2 + len(presets.PRESETS))
        for line in lines:
            self.assertIn(line, page)


if __name__ == "__main__":
    unittest.main()
