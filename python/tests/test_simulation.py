"""Simulations for a loop of one's own."""

import copy
import pickle
import tempfile
import unittest
from pathlib import Path

import numpy as np
import springs as sp

from scenes import net
from test_run import bits

METHODS = ["linearly-implicit-euler", "tr-bdf2", "filtered-leapfrog", "dop853"]


class Simulations(unittest.TestCase):
    def test_a_loop_gives_the_bits_of_a_run(self):
        s = net()
        for method in METHODS:
            how = {"step": 1 / 480, "method": method}
            r = s.run(0.5, frames=60, **how)
            with s.simulation(**how) as sim:
                for frame in range(1, 31):
                    sim.advance(1 / 60)
                    # Frames of a run lie between its steps; each second one does not.
                    if frame == 30:
                        self.assertEqual(bits(sim.x, sim.v), bits(r.x[-1], r.v[-1]), method)
                        self.assertEqual(sim.time, 0.5)
                        self.assertEqual(sim.energy["total"], r.energy["total"][-1])

    def test_what_is_saved_goes_on_with_the_same_bits(self):
        for method in METHODS:
            sim = net().simulation(step=1 / 240, method=method)
            sim.advance(0.25)
            saved = sim.save()
            others = [pickle.loads(pickle.dumps(sim)), copy.copy(sim), copy.deepcopy(sim)]
            sim.advance(0.25)
            for other in others:
                other.advance(0.25)
                self.assertEqual(bits(other.x, other.v), bits(sim.x, sim.v), method)
                self.assertEqual(other.energy, sim.energy)
            end = bits(sim.x, sim.v)
            sim.restore(saved)
            self.assertEqual(sim.time, 0.25)
            sim.advance(0.25)
            self.assertEqual(bits(sim.x, sim.v), end, method)

    def test_arrays_are_those_of_one_time(self):
        sim = net().simulation(step=0.01)
        before = sim.x
        kept = before.copy()
        self.assertIs(sim.x, before)
        self.assertFalse(before.flags.writeable)
        sim.advance(0.1)
        np.testing.assert_array_equal(before, kept)
        self.assertFalse(np.array_equal(sim.x, before))

    def test_only_whole_steps_are_made(self):
        sim = net().simulation(step=0.01)
        sim.advance(0)
        self.assertEqual(sim.time, 0)
        for dt in [0.015, -0.01, np.inf, np.nan]:
            with self.assertRaises(sp.SceneError):
                sim.advance(dt)

    def test_changes_go_on_from_where_it_is(self):
        s = net()
        rest = s.rest_length
        sim = s.simulation(step=1 / 240, method="tr-bdf2")
        start = None
        for k in range(5):
            length = rest * (1 + 0.05 * np.sin(k))
            sim.rest_length = length
            np.testing.assert_array_equal(sim.rest_length, length)
            sim.advance(1 / 60)
        self.assertEqual(sim.time, 20 * (1 / 240))
        # The same by hand, without loads that vary over time.
        x = s.x

        def changed(length):
            other = sp.Scene(gravity=(0, 0, -9.81))
            other.nodes(x, mass=1)
            other.springs(s.ij, stiffness=s.stiffness, rest_length=length, damping=0.1)
            other.fix([0, 5])
            return other

        sim = changed(rest).simulation(step=1 / 240, method="tr-bdf2")
        for k in range(5):
            length = rest * (1 + 0.05 * np.sin(k))
            sim.rest_length = length
            sim.advance(1 / 60)
            how = {"step": 1 / 240, "method": "tr-bdf2", "frames": 1}
            start = changed(length).run(4 * (1 / 240), start=start, **how)
            self.assertEqual(bits(sim.x, sim.v), bits(start.x[-1], start.v[-1]))

    def test_the_work_of_changes_is_accounted_for(self):
        # A weight on a spring: K/2 ((l - l1)^2 - (l - l0)^2) at a change of l0.
        s = sp.Scene()
        s.nodes([(0, 0, 0), (1.5, 0, 0)], mass=2)
        s.springs([(0, 1)], stiffness=50, rest_length=1)
        s.fix(0)
        sim = s.simulation(step=1e-4, method="velocity-verlet")
        work = 0.0
        for length in [1.2, 0.7, 1.0]:
            l, l0 = sim.x[1, 0], sim.rest_length[0]
            work += 25 * ((l - length) ** 2 - (l - l0) ** 2)
            sim.rest_length = [length]
            self.assertAlmostEqual(sim.energy["control_work"], work, places=12)
            sim.advance(0.3)
            self.assertLess(abs(sim.energy["method"]), 1e-5)
        l = sim.x[1, 0]
        sim.stiffness = 80
        work += 15 * (l - 1) ** 2
        self.assertAlmostEqual(sim.energy["control_work"], work, places=12)
        sim.force = [(0, 0, 0), (3, 0, 0)]
        before = sim.x[1, 0]
        sim.advance(0.2)
        energy = sim.energy
        self.assertAlmostEqual(energy["load_work"], 3 * (sim.x[1, 0] - before), places=6)
        self.assertLess(abs(energy["method"]), 1e-5)
        other = pickle.loads(pickle.dumps(sim))
        self.assertEqual((other.energy, other.time), (sim.energy, sim.time))
        np.testing.assert_array_equal(other.force, sim.force)
        with self.assertRaises(sp.SceneError) as caught:
            sim.rest_length = np.nan
        self.assertEqual(caught.exception.spring, 0)
        self.assertEqual(bits(sim.x), bits(other.x))

    def test_anchors_move_from_where_they_are(self):
        # In the frame of the anchor: x = 1 + v t - v/w sin w t.
        s = sp.Scene()
        s.nodes([(0, 0, 0), (1, 0, 0)], mass=2)
        s.springs([(0, 1)], stiffness=50)
        s.fix(0)
        sim = s.simulation(step=1e-3, method="dop853")
        sim.advance(0.1)
        sim.anchor_velocity = [(0.5, 0, 0), (0, 0, 0)]
        np.testing.assert_array_equal(sim.v[0], (0.5, 0, 0))
        sim.advance(0.2)
        self.assertAlmostEqual(sim.x[0, 0], 0.1, places=14)
        self.assertAlmostEqual(sim.x[1, 0], 1.1 - 0.1 * np.sin(1.0), places=12)
        self.assertAlmostEqual(sim.energy["anchor_work"], sim.energy["total"], places=9)
        other = pickle.loads(pickle.dumps(sim))
        np.testing.assert_array_equal(other.anchor_velocity, sim.anchor_velocity)
        for one in (sim, other):
            one.anchor_velocity = np.zeros((2, 3))
            one.advance(0.1)
        self.assertEqual(bits(sim.x, sim.v), bits(other.x, other.v))
        self.assertAlmostEqual(sim.x[0, 0], 0.1, places=14)
        with self.assertRaises(sp.SceneError) as caught:
            sim.anchor_velocity = np.ones((2, 3))
        self.assertEqual(caught.exception.node, 1)

    def test_damaged_saves_are_told(self):
        saved = net().simulation(step=1 / 240).save()
        for k in [0, len(saved) // 3, len(saved) - 1]:
            damaged = bytearray(saved)
            damaged[k] ^= 4
            for wrong in (bytes(damaged), saved[:k]):
                with self.assertRaises(sp.SceneError):
                    net().simulation(step=1 / 240).restore(wrong)

    def test_changes_keep_what_is_broken_or_has_yielded(self):
        # A weight thrown from a support, and a spring between supports to be changed.
        text = """Scene(
            version: 1,
            nodes: [(position: (0, 0, 0), fixed: true),
                    (position: (1, 0, 0), velocity: (2, 0, 0), mass: 0.5),
                    (position: (0, 9, 0), fixed: true), (position: (1, 9, 0), fixed: true)],
            springs: [(nodes: (0, 1), stiffness: 100, rest_length: 1, SPRING),
                      (nodes: (2, 3), stiffness: 100, rest_length: 1)],
        )"""
        how = {"step": 1e-3, "method": "velocity-verlet"}
        broken = 50 * 0.1**2
        for spring, lost in [
            ("breaks_at: Strain(0.1)", broken),
            ("breaks_at: Force(10)", broken),
            ("law: Plastic(yields_at: 5)", 0.875),
        ]:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "scene.ron"
                path.write_text(text.replace("SPRING", spring))
                s = sp.load(path)
            r = s.run(1.0, frames=1000, **how)
            self.assertAlmostEqual(r.energy["broken_energy"][-1], lost, delta=0.02)
            whole, changed = s.simulation(**how), s.simulation(**how)
            for k in range(1, 1001):
                whole.advance(1e-3)
                changed.advance(1e-3)
                for name in ["total", "broken_energy", "method"]:
                    self.assertEqual(whole.energy[name], r.energy[name][k], (spring, name, k))
                # After each step, so that none breaks or yields unseen.
                changed.rest_length = [1, 1 + 1e-3 * (k % 2)]
                if k == 500:
                    with self.assertRaises(sp.SceneError):
                        changed.rest_length = np.nan
                    with self.assertRaises(sp.SceneError):
                        changed.rest_length = np.nan
                    self.assertEqual(changed.time, whole.time)
                    changed = pickle.loads(pickle.dumps(changed))
            self.assertEqual(bits(whole.x, whole.v), bits(r.x[-1], r.v[-1]))
            np.testing.assert_allclose(changed.x, whole.x, atol=1e-9)
            for name in ["broken_energy", "total", "method"]:
                self.assertAlmostEqual(changed.energy[name], whole.energy[name], places=9)
            self.assertAlmostEqual(changed.energy["control_work"], 0, places=9)
            self.assertLess(abs(whole.energy["method"]), 1e-3)


if __name__ == "__main__":
    unittest.main()
