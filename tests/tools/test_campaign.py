"""What the campaigns of validation/ share: which runs are kept, which go on, and what is recorded."""

import contextlib
import io
import json
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "validation" / "tools"))
import campaign

PROGRAM = """#!/bin/sh
echo "$@" >> {calls}
echo "step 1 rejected: oscillates; half of it"
for word in "$@"; do
  case $word in status=*) exit ${{word#status=}} ;; esac
done
"""


class Folder(unittest.TestCase):
    """A campaign in `home` with a program that writes down how it was called and ends as it is told."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.home = Path(temporary.name)
        self.calls = self.home / "calls.txt"
        (self.home / "femxdem").write_text(PROGRAM.format(calls=self.calls))
        (self.home / "femxdem").chmod(0o755)
        (self.home / "case.toml").write_text("[mesh]\n")

    def arguments(self, *words):
        places = ["--runs", str(self.home / "runs"), "--femxdem", str(self.home / "femxdem")]
        return campaign.parser(self.home, "", rows=True).parse_args([*words, *places])

    def run_once(self, *settings, words=(), **more):
        return campaign.Campaign(self.home, self.arguments(*words)).run("case.toml", "one", *settings, **more)

    def called(self):
        return self.calls.read_text().splitlines() if self.calls.exists() else []

    def main(self, *words, work=lambda c: 0, **more):
        with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(said):
            status = campaign.main(self.home, self.arguments(*words), {"a": "first", "b": ""}, work, **more)
        return status, said.getvalue()


class Runs(Folder):
    def test_a_finished_run_is_kept_with_its_status_and_what_it_said(self):
        for status in (0, 2, 3):
            self.calls.unlink(missing_ok=True)
            first, again = self.run_once(f"status={status}"), self.run_once(f"status={status}")
            self.assertEqual(len(self.called()), 1)
            self.assertEqual((first.status, again.status), (status, status))
            self.assertEqual(again.rejections(), ["oscillates"])

    def test_other_settings_another_case_or_anew_start_again(self):
        self.run_once("a=1")
        self.run_once("a=2")
        (self.home / "case.toml").write_text("[mesh]\nnx = 2\n")
        self.run_once("a=2")
        self.run_once("a=2", words=["--anew"])
        self.assertEqual(len(self.called()), 4)
        self.assertTrue(all("--overwrite" in call for call in self.called()))

    def test_an_interrupted_run_goes_on_from_its_checkpoint(self):
        self.run_once("a=1", checkpoint_every=5)
        self.assertIn("output.checkpoint_every=5", self.called()[0])
        note = self.home / "runs" / "one" / "campaign.json"
        note.write_text(json.dumps({**json.loads(note.read_text()), "status": None}))
        self.run_once("a=1", checkpoint_every=5)
        self.assertIn("--overwrite", self.called()[1])
        note.write_text(json.dumps({**json.loads(note.read_text()), "status": None}))
        (note.parent / "checkpoint.h5").touch()
        (note.parent / "history.csv").write_text("step,time\n1,1\n")
        run = self.run_once("a=1", checkpoint_every=5)
        self.assertIn("--restart", self.called()[2])
        self.assertNotIn("--overwrite", self.called()[2])
        self.assertEqual(run.steps(), 1)

    def test_a_checkpoint_that_does_not_serve_is_an_error_not_a_result(self):
        self.run_once("status=4")
        (self.home / "runs" / "one" / "checkpoint.h5").touch()
        (self.home / "femxdem").write_text("#!/bin/sh\necho checkpoint: written by another version >&2\nexit 2\n")
        with self.assertRaisesRegex(campaign.CampaignError, "another version; --anew"):
            self.run_once("status=4")

    def test_a_failed_volume_element_is_tried_again(self):
        self.run_once("status=4")
        self.run_once("status=4")
        self.assertEqual(len(self.called()), 2)

    def test_nothing_of_an_earlier_run_is_left_where_a_new_one_writes_nothing(self):
        self.run_once("a=1")
        (self.home / "runs" / "one" / "history.csv").write_text("step,time\n1,1\n")
        self.assertEqual(self.run_once("status=2").history(), {})

    def test_values_are_kept(self):
        c, measured = campaign.Campaign(self.home, self.arguments()), []
        measure = lambda: measured.append(1) or {"x": 0.1}
        self.assertEqual([c.value("v", {"n": n}, measure) for n in (1, 1, 2)], 3 * [{"x": 0.1}])
        self.assertEqual(len(measured), 2)


class Options(Folder):
    def test_list_runs_nothing(self):
        status, said = self.main("--list", work=lambda c: self.fail("it worked"))
        self.assertEqual((status, said), (0, "a                    first\nb\n"))
        self.assertFalse((self.home / "runs").exists())

    def test_unknown_rows_and_useless_ranks_are_refused(self):
        self.assertEqual(self.main("c")[0], 2)
        self.assertIn("no row c", self.main("c")[1])
        self.assertEqual(self.main("--ranks", "2")[0], 2)
        self.assertEqual(self.main("--ranks", "2", on_meshes=True)[0], 0)

    def test_a_program_that_is_not_there_is_named(self):
        (self.home / "femxdem").unlink()
        status, said = self.main(work=lambda c: c.run("case.toml", "one").status)
        self.assertEqual(status, 2)
        self.assertIn("femxdem is not there; build it", said)

    def test_record_puts_the_table_between_the_marks_and_the_figure_beside(self):
        page = self.home / "README.md"
        page.write_text("# Case\n\n<!-- results -->\nold\n<!-- end of results -->\ntail\n")

        def work(c):
            c.table(["| x |", "|---|", "| 1 |"])
            c.product("figure.png").write_bytes(b"png")

        self.main(work=work)
        self.assertIn("old", page.read_text())
        sys_argv, sys.argv = sys.argv, [str(ROOT / "validation" / "one" / "run.py"), "--seeds", "1", "--runs", "here", "--record"]
        try:
            self.main("--record", work=work)
        finally:
            sys.argv = sys_argv
        self.assertRegex(page.read_text(), r"(?s)# Case\n\n<!-- results -->\n[^\n]*`validation/one/run.py --seeds 1`\n\n\| x \|\n\|---\|\n\| 1 \|\n"
                                           r"<!-- end of results -->\ntail\n$")
        self.assertTrue((self.home / "figure.png").exists())


if __name__ == "__main__":
    unittest.main()
