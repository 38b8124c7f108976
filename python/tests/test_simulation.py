"""Simulations for a loop of one's own."""

import copy
import pickle
import unittest

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


if __name__ == "__main__":
    unittest.main()
