"""Runs: arrays without copies, other threads, interrupts, the command line's bits."""

import functools
import json
import os
import signal
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
import springs as sp

from scenes import block, net

ROOT = Path(__file__).parents[2]


def bits(*arrays):
    return [np.ascontiguousarray(array).tobytes() for array in arrays]


def all_bits(result):
    return bits(result.t, result.x, result.v, result.tension, *result.energy.values())


class Runs(unittest.TestCase):
    def test_arrays_leave_without_a_copy(self):
        r = net().run(0.1, step=0.01, frames=5)
        for array in [r.t, r.x, r.v, r.tension, *r.energy.values()]:
            # The memory is that of the vector that frames were written to.
            self.assertFalse(array.flags.owndata)
            self.assertEqual(type(array.base).__name__, "PySliceContainer")
        pointers = [r.x.ctypes.data for _ in range(3)]
        self.assertEqual(len(set(pointers)), 1)
        self.assertEqual(np.shares_memory(r.x[2:], r.x), True)
        self.assertEqual((r.x.shape, r.v.shape), ((6, 36, 3), (6, 36, 3)))
        self.assertEqual((r.t.shape, r.tension.shape), ((6,), (6, 60)))

    def test_the_energies_add_up(self):
        r = net().run(1.0, tolerance=1e-5)
        e = r.energy
        total = e["kinetic"] + e["elastic"] + e["gravity"]
        np.testing.assert_allclose(e["total"], total, atol=1e-12)
        change = e["total"] - e["total"][0]
        flows = e["anchor_work"] + e["load_work"] - e["dashpot_heat"] - e["broken_energy"]
        flows += e["method"]
        np.testing.assert_allclose(change, flows, atol=1e-12)
        self.assertLess(abs(e["method"][-1]), 1e-4)
        self.assertEqual(r.report["energy"]["method_gain"], e["method"][-1])
        self.assertEqual(r.status, "finished")

    def test_loads_have_works_of_their_own(self):
        s = sp.Scene()
        s.nodes(np.zeros((2, 3)), mass=2.0)
        s.load(0, [3.0, 0.0, 0.0], name="tug")
        s.load([0, 1], [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], times=[0.0, 1.0])
        r = s.run(1.0, tolerance=1e-8)
        tug, ramp = r.report["energy"]["loads"]
        self.assertEqual((tug["name"], tug["nodes"], ramp["nodes"]), ("tug", 1, 2))
        # F²t²/2m, and twice ∫ t·t²/2m dt.
        self.assertAlmostEqual(tug["work"], 9 / 4, places=6)
        self.assertAlmostEqual(ramp["work"], 2 / 16, places=6)

    def test_a_run_starts_where_another_one_ended(self):
        s = net()
        first = s.run(0.5, step=0.01)
        second = s.run(0.5, step=0.01, start=first)
        self.assertEqual(bits(second.x[0], second.v[0]), bits(first.x[-1], first.v[-1]))

        class Equilibrium:
            x = first.x[-1]

        third = s.run(0.5, step=0.01, start=Equilibrium())
        self.assertEqual(bits(third.x[0]), bits(first.x[-1]))
        np.testing.assert_array_equal(third.v[0], 0)

    def test_threads_and_repeats_give_the_same_bits(self):
        s = net()
        runs = [s.run(0.5, tolerance=1e-4, threads=threads) for threads in [1, 2, 2]]
        self.assertEqual(all_bits(runs[0]), all_bits(runs[1]))
        self.assertEqual(all_bits(runs[1]), all_bits(runs[2]))

    def test_another_thread_counts_meanwhile(self):
        s = net()
        count, is_done = 0, False

        def counting():
            nonlocal count
            while not is_done:
                count += 1
                time.sleep(0.001)

        counter = threading.Thread(target=counting)
        counter.start()
        try:
            before, begin = count, time.perf_counter()
            s.run(100.0, step=1e-3, method="velocity-verlet", frames=1)
            counted, seconds = count - before, time.perf_counter() - begin
            sim = s.simulation(step=1e-3, method="velocity-verlet")
            before = count
            sim.advance(100.0)
            counted_inline = count - before
        finally:
            is_done = True
            counter.join()
        self.assertGreater(counted, 20 * seconds, f"in {seconds} s")
        self.assertGreater(counted_inline, 20 * seconds)

    def test_progress_is_told(self):
        told = []
        net().run(200.0, step=1e-3, method="velocity-verlet", frames=1, progress=told.append)
        self.assertEqual(told, sorted(told))
        self.assertEqual(told[-1], 1.0)
        self.assertTrue(all(0 <= done <= 1 for done in told))

        def fail(done):
            raise RuntimeError("enough")

        with self.assertRaisesRegex(RuntimeError, "enough") as caught:
            net().run(1e6, step=1e-3, method="velocity-verlet", frames=1, progress=fail)
        self.assertEqual(caught.exception.result.status, "interrupted")

    def test_files_of_a_run(self):
        r = net().run(0.2, step=0.01, frames=4)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "net.npz"
            r.save(path)
            with np.load(path) as arrays:
                saved = bits(*(arrays[name] for name in ["time", "position", "velocity", "tension"]))
            self.assertEqual(saved, bits(r.t, r.x, r.v, r.tension))
            page = r.view(Path(folder) / "net.html")
            self.assertIn("<html", Path(page).read_text())
            self.assertEqual(sorted(os.listdir(folder)), ["net.html", "net.npz"])
        self.assertTrue(r._repr_html_().startswith("<svg"))


class CommandLine(unittest.TestCase):
    @staticmethod
    @functools.cache
    def program():
        subprocess.run(["cargo", "build", "--quiet"], cwd=ROOT, check=True)
        metadata = ["cargo", "metadata", "--no-deps", "--format-version=1"]
        out = subprocess.run(metadata, cwd=ROOT, check=True, capture_output=True, text=True).stdout
        return Path(json.loads(out)["target_directory"]) / "debug" / "springs"

    def test_the_same_bits(self):
        for flags, how in [
            (["--tolerance", "1e-4"], {"tolerance": 1e-4}),
            (["--step", "0.01", "--method", "tr-bdf2"], {"step": 0.01, "method": "tr-bdf2"}),
            (["--step", "0.01"], {"step": 0.01}),
        ]:
            s = net()
            with tempfile.TemporaryDirectory() as folder:
                scene, out = Path(folder) / "net.ron", Path(folder) / "out"
                s.write(scene)
                command = [self.program(), "run", scene, "--out", out, "--write", "npz", "--quiet"]
                command += ["--duration", "1", "--frames", "30", *flags]
                subprocess.run(command, check=True)
                result = s.run(1.0, frames=30, **how)
                result.save(Path(folder) / "net.npz")
                ours, theirs = Path(folder) / "net.npz", out / "trajectory.npz"
                self.assertEqual(ours.read_bytes(), theirs.read_bytes(), flags)


def interrupt_after(seconds):
    """Sends the signal of Ctrl-C, and returns when, as the only element of a list."""
    sent = []

    def send():
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(seconds, send).start()
    return sent


class Interrupts(unittest.TestCase):
    #: Seconds from the signal to the exception: 0.1, and what a busy machine adds.
    SOON = 0.3

    def interrupted(self, work, after=0.3):
        sent = interrupt_after(after)
        with self.assertRaises(KeyboardInterrupt) as caught:
            work()
        seconds = time.perf_counter() - sent[0]
        self.assertLess(seconds, self.SOON)
        return caught.exception

    def test_steps(self):
        s = net()
        how = {"step": 2e-5, "method": "velocity-verlet", "frames": 20}
        whole = s.run(4.0, **how)
        error = self.interrupted(lambda: s.run(4.0, **how), after=0.1)
        self.assertIsInstance(error, sp.Interrupted)
        part = error.result
        self.assertEqual(part.status, "interrupted")
        self.assertEqual(part.time, error.time)
        self.assertEqual(bits(part.x), bits(whole.x[: len(part.x)]))
        self.assertEqual(all_bits(part.resume()), all_bits(whole))
        with self.assertRaises(sp.Error):
            whole.resume()

    def test_trial_runs(self):
        s = net(12)
        error = self.interrupted(
            lambda: s.run(60.0, tolerance=1e-7, method="implicit-midpoint", frames=2)
        )
        self.assertEqual(error.result.status, "interrupted")

    def test_factorizations(self):
        s = block(16)
        self.interrupted(lambda: s.run(100.0, step=1.0, method="tr-bdf2", frames=1), after=1.0)
        sim = s.simulation(step=0.1, method="tr-bdf2")
        self.interrupted(lambda: sim.advance(1000.0), after=0.5)

    def test_loops(self):
        s = net()
        sim = s.simulation(step=1e-5, method="velocity-verlet")
        self.interrupted(lambda: sim.advance(1000.0))
        steps = round(sim.time / 1e-5)
        other = s.simulation(step=1e-5, method="velocity-verlet")
        other.advance(sim.time)
        self.assertEqual(bits(sim.x, sim.v), bits(other.x, other.v), f"{steps} steps")
        sim.advance(0.01)

    def test_studies(self):
        error = self.interrupted(lambda: net().study(budget=60.0), after=2.0)
        self.assertIsInstance(error, KeyboardInterrupt)


class Starts(unittest.TestCase):
    def test_what_broke_and_yielded_stays_so(self):
        text = """Scene(version: 1,
            nodes: [(position: (0, 0, 0), fixed: true),
                    (position: (1, 0, 0), velocity: (2, 0, 0), mass: 0.5),
                    (position: (3, 0, 0), velocity: (1, 0, 0), mass: 0.5)],
            springs: [(nodes: (0, 1), stiffness: 100, breaks_at: Strain(0.1)),
                      (nodes: (1, 2), stiffness: 100, rest_length: 1.9, law: Plastic(yields_at: 5))])"""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.ron"
            path.write_text(text)
            s = sp.load(path)
        how = {"step": 1e-3, "method": "velocity-verlet"}
        whole, half = s.run(1.0, frames=2, **how), s.run(0.5, frames=1, **how)
        np.testing.assert_array_equal(half.broken, [True, False])
        self.assertGreater(half.yielded[1], 0)
        with s.simulation(**how) as sim:
            sim.advance(0.5)
            np.testing.assert_array_equal(sim.broken, half.broken)
            np.testing.assert_array_equal(sim.yielded, half.yielded)
            for start in (half, sim):
                rest = s.run(0.5, start=start, frames=1, **how)
                self.assertEqual(bits(rest.x[-1], rest.v[-1]), bits(whole.x[-1], whole.v[-1]))
                np.testing.assert_array_equal(rest.yielded, whole.yielded)

    def test_pictures_have_broken_springs_and_loads_as_the_command_line(self):
        text = """Scene(version: 1,
            nodes: [(position: (0, 0, 0), fixed: true),
                    (position: (1, 0, 0), velocity: (2, 0, 0), mass: 0.5)],
            springs: [(nodes: (0, 1), stiffness: 100, breaks_at: Strain(0.1))],
            loads: [(nodes: [1], force: (0, 0, -8), over_time: Ramp(from: 0, to: 4))],
            simulation: (method: VelocityVerlet, step: 1e-3, duration: 1),
            output: (frames: 4))"""
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            (folder / "scene.ron").write_text(text)
            r = sp.load(folder / "scene.ron").run()
            self.assertEqual(len(r.t), 5)
            picture = r._repr_html_()
            page = r.view(folder / "ours.html").read_text()
            program = [CommandLine.program(), "run", folder / "scene.ron", "--out", folder / "out"]
            subprocess.run([*program, "--write", "view,svg", "--quiet"], check=True)
            self.assertEqual(page, (folder / "out" / "view.html").read_text())
            self.assertEqual(picture, (folder / "out" / "filmstrip.svg").read_text())
        self.assertIn("broken", picture)


if __name__ == "__main__":
    unittest.main()
