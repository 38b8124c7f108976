"""Sweeps: many runs with any executor."""

import contextlib
import io
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import springs as sp

HOW = {"duration": 0.5, "step": 1e-3, "method": "velocity-verlet"}
GRID = {"EA": np.logspace(2, 8, 4), "damping_ratio": [0.01, 0.1]}
MEASURES = ["max(tension)", "final(z[1])"]


def weight():
    """A weight on a wire, which oscillates about its sag."""
    s = sp.Scene(gravity=(0, 0, -9.81))
    s.nodes([(0, 0, 0), (0, 0, -1)], mass=2)
    s.springs([(0, 1)], EA=1000, damping_ratio=0.05)
    s.fix(0)
    return s


def lowest(result):
    return {"lowest": result.x[:, 1, 2].min(), "frames": len(result.t)}


def program():
    """The command line, if it was built."""
    name = os.environ.get("SPRINGS_PROGRAM") or shutil.which("springs")
    built = Path(__file__).parents[2] / "target"
    places = [Path(name)] if name else [built / kind / "springs" for kind in ("release", "debug")]
    return next((place for place in places if place.is_file()), None)


class Sweeps(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def table(self, name, **more):
        found = sp.sweep(weight(), GRID, measure=MEASURES, out=self.folder / name, **HOW, **more)
        return found, (self.folder / name / "results.csv").read_bytes()

    def test_each_run_is_what_it_is_by_itself(self):
        found, table = self.table("one")
        self.assertEqual(len(found), 8)
        lines = table.decode().splitlines()
        self.assertEqual(lines[0], "run,EA,damping_ratio,max(tension),final(z[1]),failure")
        for run in range(6):
            s = sp.Scene(gravity=(0, 0, -9.81))
            s.nodes([(0, 0, 0), (0, 0, -1)], mass=2)
            ea, ratio = found.settings["EA"][run], found.settings["damping_ratio"][run]
            s.springs([(0, 1)], EA=ea, damping_ratio=ratio)
            s.fix(0)
            r = s.run(**HOW)
            self.assertEqual(found.measures["final(z[1])"][run], r.x[-1, 1, 2])
            self.assertGreaterEqual(found.measures["max(tension)"][run], r.tension.max())
            # Of the largest swing, 2 m g, dashpots take a part.
            self.assertLess(found.measures["max(tension)"][run], 2 * 2 * 9.81)
        # These steps are too long for velocity Verlet.
        self.assertEqual(list(found.failures), [6, 7])
        self.assertTrue(all("energy diverged" in why for why in found.failures.values()))
        self.assertTrue(np.isnan(found.measures["max(tension)"][6:]).all())

    def test_the_executor_makes_no_difference(self):
        _, expected = self.table("one")
        for k, kind in enumerate([ThreadPoolExecutor(2), ProcessPoolExecutor(1), ProcessPoolExecutor(3)]):
            with kind as executor:
                self.assertEqual(self.table(f"executor {k}", executor=executor)[1], expected)

    def test_the_command_line_comes_to_the_same(self):
        springs = program()
        if springs is None:
            self.skipTest("the command line is not built (cargo build)")
        _, table = self.table("python")
        scene = self.folder / "weight.ron"
        weight().with_settings(**HOW).write(scene)
        command = [springs, "sweep", scene, "--out", self.folder / "out", "--quiet"]
        command += ["--set", "EA=" + ",".join(f"{ea!r}" for ea in GRID["EA"].tolist())]
        command += ["--set", "damping_ratio=0.01,0.1", "--measure", "max(tension)"]
        subprocess.run([*command, "--measure", "final(z[1])"], check=True)
        lines = (self.folder / "out" / "results.csv").read_text().splitlines()
        for line, own in zip(lines[1:7], table.decode().splitlines()[1:]):
            numbers = [float(number) for number in line.split(",")[:-1]]
            self.assertEqual(numbers, [float(number) for number in own.split(",")[:-1]])

    def test_a_function_measures(self):
        found = sp.sweep(weight(), {"EA": [1e2, 1e4]}, measure=lowest, frames=50, **HOW)
        np.testing.assert_array_equal(found.measures["frames"], [51, 51])
        sag = 2 * 9.81 / np.array([1e2, 1e4])
        self.assertTrue((found.measures["lowest"] < -1 - sag).all())
        self.assertTrue((found.measures["lowest"] > -1 - 2.01 * sag).all())

    def test_what_is_wrong_is_told_at_once(self):
        for settings, measure in [
            ({"colour": [1]}, "steps"),
            ({"EA": [1, -1]}, "steps"),
            ({"EA": []}, "steps"),
            ({}, "steps"),
        ]:
            with self.assertRaises(sp.SceneError):
                sp.sweep(weight(), settings, measure=measure, **HOW)
        with self.assertRaises(sp.SceneError) as caught:
            weight().changed_by({"colour": 1})
        self.assertIn("of springs stiffness, EA", str(caught.exception))
        with self.assertRaises(sp.SceneError) as caught:
            weight().measure(["max(colour)"])
        self.assertIn("there are max(Q)", str(caught.exception))

    def test_another_sweep_does_not_go_into_the_folder(self):
        self.table("one")
        with self.assertRaises(sp.SceneError):
            sp.sweep(weight(), {"EA": [1]}, measure=MEASURES, out=self.folder / "one", **HOW)

    def test_one_that_was_killed_goes_on(self):
        script = self.folder / "killed.py"
        script.write_text(
            "import sys\n"
            f"sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
            "import numpy as np, springs as sp\n"
            "from test_sweep import HOW, MEASURES, weight\n"
            "if __name__ == '__main__':\n"
            "    sp.sweep(weight(), {'EA': np.logspace(2, 4, 200)}, measure=MEASURES, out=sys.argv[1], **HOW)\n"
        )

        def start(name):
            return subprocess.Popen([sys.executable, script, self.folder / name], stderr=subprocess.DEVNULL)

        self.assertEqual(start("whole").wait(), 0)
        moments = random.Random(3)
        for _ in range(4):
            child = start("killed")
            time.sleep(moments.uniform(0.2, 0.6))
            child.kill()
            child.wait()
        self.assertEqual(start("killed").wait(), 0)
        tables = [(self.folder / name / "results.csv").read_bytes() for name in ("whole", "killed")]
        self.assertEqual(*tables)
        self.assertEqual(tables[0].count(b"\n"), 201)

    def test_dask_runs_it(self):
        try:
            from dask.distributed import Client, LocalCluster
        except ImportError:
            self.skipTest("Dask is not installed (pip install distributed)")
        _, expected = self.table("one")
        options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
        with LocalCluster(**options) as cluster, Client(cluster) as client:
            with client.get_executor() as executor:
                self.assertEqual(self.table("dask", executor=executor)[1], expected)

    def test_hyperqueue_runs_it(self):
        try:
            from hyperqueue import Job, LocalCluster
            from hyperqueue.cluster import WorkerConfig
        except ImportError:
            self.skipTest("HyperQueue is not installed (pip install hyperqueue)")
        springs = program()
        if springs is None:
            self.skipTest("the command line is not built (cargo build)")
        scene = self.folder / "weight.ron"
        weight().with_settings(**HOW).write(scene)

        def prepare(name, workers):
            command = [springs, "sweep", scene, "--out", self.folder / name, "--quiet"]
            command += ["--workers", str(workers), "--set", "EA=log:1e2:1e4:40"]
            subprocess.run([*command, "--measure", "max(tension)"], check=True)

        prepare("whole", 1)
        prepare("queued", 0)
        said = contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO())
        with said[0], said[1], LocalCluster() as cluster:
            cluster.start_worker(WorkerConfig(cores=2))
            client = cluster.client()
            job = Job(default_workdir=self.folder)
            for _ in range(2):
                job.program([str(springs), "sweep", "work", "queued", "--quiet"])
            client.wait_for_jobs([client.submit(job)])
        tables = [(self.folder / name / "results.csv").read_bytes() for name in ("whole", "queued")]
        self.assertEqual(*tables)


if __name__ == "__main__":
    unittest.main()
