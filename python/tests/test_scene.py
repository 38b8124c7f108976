"""Scenes from arrays."""

import copy
import pickle
import tempfile
import unittest
from pathlib import Path

import numpy as np
import springs as sp

from scenes import net

EXAMPLES = Path(__file__).parents[2] / "examples" / "scenes"


def text_of(scene):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.ron"
        scene.write(path)
        return path.read_text()


class Closed:
    """An array that cannot be asked for its elements."""

    def __init__(self, array):
        self.array = array

    def __array__(self, dtype=None, copy=None):
        return self.array if dtype is None else self.array.astype(dtype, copy=False)

    def __getitem__(self, index):
        raise AssertionError("an element was asked for")

    def __iter__(self):
        raise AssertionError("elements were asked for")

    def __len__(self):
        raise AssertionError("the length was asked for")


class Scenes(unittest.TestCase):
    def test_arrays_are_read_as_a_whole(self):
        x = np.arange(30.0).reshape(10, 3)
        s = sp.Scene()
        indices = s.nodes(Closed(x), mass=Closed(np.ones(10)))
        np.testing.assert_array_equal(indices, np.arange(10))
        ij = np.stack([np.arange(9), np.arange(1, 10)], axis=1)
        s.springs(Closed(ij), stiffness=Closed(np.full(9, 10.0)))
        s.fix(Closed(np.arange(10) == 0))
        np.testing.assert_array_equal(s.x, x)
        np.testing.assert_array_equal(s.ij, ij)
        # Any layout and type that numpy can make numbers of.
        s.nodes(np.asfortranarray(x), mass=np.float32(1))
        s.nodes(x.astype(np.int32)[::-1], mass=1)
        np.testing.assert_array_equal(s.x, np.concatenate([x, x, x[::-1]]))

    def test_springs_are_what_engineers_say(self):
        s = sp.Scene()
        s.nodes([(0, 0, 0), (2, 0, 0), (2, 2, 0)], mass=[1, 1, 3])
        s.springs([(0, 1)], EA=100, pretension=25, mass_per_length=0.5)
        s.springs([(1, 2)], stiffness=100, prestrain=0.25)
        np.testing.assert_allclose(s.rest_length, [1.6, 1.6], rtol=1e-15)
        np.testing.assert_allclose(s.stiffness, [62.5, 100], rtol=1e-15)
        np.testing.assert_allclose(s.mass, [1.4, 1.4, 3], rtol=1e-15)

    def test_a_damping_ratio_is_that_of_the_final_masses(self):
        # One weight on one spring: x'' + 2 z w x' + w^2 x = 0, with w = 10, z = 0.3.
        s = sp.Scene()
        s.nodes([(0, 0, 0), (1, 0, 0)])
        s.springs([(0, 1)], stiffness=100, rest_length=0.9, damping_ratio=0.3)
        s.springs([(0, 1)], stiffness=0, rest_length=1, mass=2)
        s.fix(0)
        r = s.run(1.0, tolerance=1e-9, frames=50)
        w, z = 10.0, 0.3
        wd = w * np.sqrt(1 - z * z)
        exact = 0.9 + 0.1 * np.exp(-z * w * r.t) * (
            np.cos(wd * r.t) + z * w / wd * np.sin(wd * r.t)
        )
        np.testing.assert_allclose(r.x[:, 1, 0], exact, atol=1e-8)

    def test_supports(self):
        s = sp.Scene(gravity=(1, 2, 3))
        s.nodes(np.eye(3), mass=1)
        s.fix(1, axes="z")
        s.fix([1], axes="y")
        s.fix(np.array([False, False, True]))
        times = np.linspace(0, 1, 11)
        motion = np.zeros((11, 3))
        motion[:, 0] = 0.1 * np.sin(times) ** 2
        s.fix(0, motion=motion, times=times)
        r = s.run(1.0, step=0.01, frames=10)
        moved = r.x - r.x[0]
        np.testing.assert_allclose(moved[:, 0], motion, atol=1e-12)
        np.testing.assert_allclose(moved[:, 1, 0], r.t**2 / 2, atol=1e-2)
        np.testing.assert_array_equal(moved[:, 1, 1:], 0)
        np.testing.assert_array_equal(moved[:, 2], 0)

    def test_loads_are_straight_lines_between_times(self):
        s = sp.Scene()
        s.nodes([(0, 0, 0), (5, 0, 0)], mass=2)
        s.load(0, force=[(0, 0, 0), (4, 0, -2)], times=[0, 1])
        s.load([1], force=(0, 6, 0))
        r = s.run(1.0, tolerance=1e-9, frames=4)
        acceleration = np.array([2, 0, -1])
        exact = acceleration * r.t[:, None] ** 3 / 6
        np.testing.assert_allclose(r.x[:, 0], exact, atol=1e-8)
        np.testing.assert_allclose(r.x[:, 1, 1], 1.5 * r.t**2, atol=1e-8)

    def test_laws(self):
        def pulled(law, x):
            s = sp.Scene()
            s.nodes([(0, 0, 0), (x, 0, 0)])
            s.springs([(0, 1)], None if "Pol" in repr(law) or "Tab" in repr(law) else 10,
                      rest_length=1, law=law)
            s.fix([0, 1])
            return s.run(0.1, step=0.1).tension[0, 0]

        self.assertEqual(pulled("tension-only", 0.5), 0)
        self.assertEqual(pulled("linear", 0.5), -5)
        self.assertEqual(pulled("compression-only", 0.5), -5)
        self.assertEqual(pulled(sp.Law.bilinear(4), 0.5), -2)
        self.assertAlmostEqual(pulled(sp.Law.limit(0.1, 20, 0), 1.5), 13)
        self.assertAlmostEqual(pulled(sp.Law.power(2), 1.5), 2.5)
        self.assertAlmostEqual(pulled(sp.Law.polynomial([10, 4]), 1.5), 6)
        self.assertAlmostEqual(pulled(sp.Law.table([(0, 0), (0.5, 7)]), 1.5), 7)

    def test_pickled_scenes_are_the_same(self):
        for path in EXAMPLES.glob("*.ron"):
            scene = sp.load(path)
            self.assertEqual(text_of(pickle.loads(pickle.dumps(scene))), text_of(scene))

    def test_pickled_scenes_keep_materials_and_damping_ratios(self):
        text = """Scene(version: 1, materials: {"wire": (EA: 0.3, damping_ratio: 0.1)},
            nodes: [(position: (0, 0, 0), fixed: true), (position: (0.7, 0, 0), mass: 0.1)],
            springs: [(nodes: (0, 1), material: "wire")])"""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.ron"
            path.write_text(text)
            scene = sp.load(path)
        other = pickle.loads(pickle.dumps(scene))
        for setting in [{"materials.wire.EA": 0.6}, {"damping_ratio*": 2.0}, {"nodes.mass": 0.7}]:
            self.assertEqual(text_of(other.changed_by(setting)), text_of(scene.changed_by(setting)))
        self.assertIn("material wire", str(other.check()))
        self.assertIn('name: "net"', text_of(net()))

    def test_equilibria(self):
        # A weight of 2 N on a spring of 100 N/m, and one that nothing holds sideways.
        s = sp.Scene(gravity=(0, 0, -10))
        s.nodes([(0, 0, 0), (0.3, 0, -1)], mass=0.2)
        s.springs([(0, 1)], stiffness=100, rest_length=1)
        s.fix(0)
        eq = s.settle()
        self.assertTrue(eq.stable)
        self.assertEqual((eq.status, eq.nodes), ("stable", []))
        np.testing.assert_allclose(eq.x[1], (0, 0, -1.02), atol=1e-9)
        np.testing.assert_allclose(eq.tension, [2], atol=1e-9)
        np.testing.assert_allclose(eq.reactions, [(0, 0, 4), (0, 0, 0)], atol=1e-9)
        r = s.run(1.0, start=eq, step=0.01)
        np.testing.assert_allclose(r.x, np.broadcast_to(eq.x, r.x.shape), atol=1e-9)
        # Nothing holds this one.
        s.nodes([(1, 1, 1)], mass=1)
        with self.assertRaises(sp.Error) as caught:
            s.settle()
        self.assertEqual(caught.exception.node, 2)

    def test_scenes_start_from_their_equilibrium_if_they_ask_for_it(self):
        text = """Scene(version: 1, gravity: (0, 0, -10),
            nodes: [(position: (0, 0, 0), fixed: true), (position: (0, 0, -1), mass: 0.2)],
            springs: [(nodes: (0, 1), stiffness: 100, rest_length: 1)],
            simulation: (start: Equilibrium, duration: 0.1))"""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.ron"
            path.write_text(text)
            s = sp.load(path)
        self.assertAlmostEqual(s.run().x[0, 1, 2], -1.02, places=9)
        self.assertAlmostEqual(s.simulation(step=0.1).x[1, 2], -1.02, places=9)
        self.assertEqual(s.x[1, 2], -1)
        s.check()

    def test_copies_are_apart(self):
        s = net()
        for other in [copy.copy(s), copy.deepcopy(s)]:
            self.assertEqual(text_of(other), text_of(s))
            other.nodes([(9, 9, 9)], mass=1)
            self.assertEqual(len(other.x), len(s.x) + 1)

    def test_the_doctor(self):
        s = net()
        s.springs([(0, 1)], stiffness=1)
        check = s.check()
        self.assertIn("spring 60: another spring joins the same two nodes", str(check))
        self.assertTrue(check.suspicious)
        self.assertEqual(str(check), repr(check))
        report = check.report
        self.assertEqual(report["contents"]["springs"], 61)
        named = [warning for warning in report["warnings"] if warning["springs"] == [60]]
        self.assertEqual(len(named), 1)
        self.assertIn(named[0]["message"], str(check))
        self.assertEqual(len(check.skipped), len(report["skipped"]))


class Errors(unittest.TestCase):
    def raised(self, work, **attributes):
        with self.assertRaises(sp.Error) as caught:
            work()
        error = caught.exception
        for name in ["node", "spring", "time"]:
            self.assertEqual(getattr(error, name), attributes.get(name), f"{name} of {error}")
        self.assertEqual(str(pickle.loads(pickle.dumps(error))), str(error))
        return error

    def test_every_error_says_where(self):
        s = sp.Scene()
        s.nodes(np.eye(3), mass=1)
        self.raised(lambda: s.nodes([(1, 2)]))
        self.raised(lambda: s.nodes("nodes"))
        self.raised(lambda: s.nodes([(1, 2, 3)], mass=[1, 2]))
        self.raised(lambda: s.springs([(0, 1, 2)], 1.0))
        self.raised(lambda: s.springs([(0.5, 1)], 1.0))
        self.raised(lambda: s.springs([(0, 1)]))
        self.raised(lambda: s.springs([(0, 1)], 1.0, EA=1.0))
        self.raised(lambda: s.springs([(0, 1)], 1.0, law="elastic"))
        self.raised(lambda: s.springs([(0, 1)], law=sp.Law.power(0.5)))
        self.raised(lambda: s.springs([(0, 1), (0, 9)], 1.0), node=9, spring=1)
        self.raised(lambda: s.springs([(0, 1)], 1.0, pretension=9.0), spring=0)
        self.raised(lambda: s.springs([(0, 1)], 1.0, prestrain=-2.0), spring=0)
        self.raised(lambda: s.fix(3), node=3)
        self.raised(lambda: s.fix([-1]))
        self.raised(lambda: s.fix([True]))
        self.raised(lambda: s.fix(0, axes="w"))
        self.raised(lambda: s.fix(0, motion=[(0, 0, 0)]))
        self.raised(lambda: s.load(7, (0, 0, 1)), node=7)
        self.raised(lambda: s.load(0, (0, 1)))
        self.raised(lambda: s.run(-1))
        self.raised(lambda: s.run(1, step=0.1, tolerance=0.1))
        self.raised(lambda: s.run(1, method="euler"))
        self.raised(lambda: s.run(1, frames=0))
        self.raised(lambda: s.run(1, start=s.x))
        self.raised(lambda: s.simulation(step=0))
        self.raised(lambda: s.simulation(step=0.1).advance(0.15))
        self.raised(lambda: s.simulation(step=0.1).restore(b"springs"))
        self.raised(lambda: s.study(-1))
        self.raised(lambda: s.write("/nowhere/scene.ron"))
        self.raised(lambda: sp.load("/nowhere/scene.ron"))
        # Nothing of what failed is in the scene.
        self.assertEqual((len(s.x), len(s.ij)), (3, 0))
        s.nodes([(np.nan, 0, 0)], mass=1)
        self.raised(lambda: s.run(1), node=3)
        self.raised(lambda: s.write("scene.ron"), node=3)
        self.raised(lambda: pickle.dumps(s), node=3)

    def test_faults_of_files_have_their_place(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.ron"
            path.write_text("Scene(version: 1, nodes: [(position: (0, 0, 0), mass: -1)])")
            error = self.raised(lambda: sp.load(path), node=0)
            self.assertIn("scene.ron:1:", str(error))

    def test_damping_ratios_need_masses(self):
        s = sp.Scene()
        s.nodes(np.eye(3), mass=[1, 0, 0])
        s.springs([(0, 1), (1, 2)], 1.0, damping_ratio=0.1)
        self.raised(lambda: s.run(1), node=1, spring=0)

    def test_what_fails_on_the_way_keeps_its_result(self):
        s = sp.Scene()
        s.nodes([(0, 0, 0), (1, 0, 0)], mass=1)
        s.springs([(0, 1)], 1e4, rest_length=0.5)
        with self.assertRaises(sp.StepError) as caught:
            s.run(10, step=1, method="velocity-verlet", frames=10)
        error = caught.exception
        self.assertEqual(error.time, error.result.time)
        self.assertIn(error.node, [0, 1])
        self.assertEqual(error.spring, 0)
        self.assertEqual(error.result.status, "failed")
        self.assertEqual(len(error.result.x), len(error.result.t))


class Ratios(unittest.TestCase):
    def test_a_negative_damping_ratio_is_not_written(self):
        s = sp.Scene()
        s.nodes([(0, 0, 0), (1, 0, 0)], mass=1)
        s.springs([(0, 1)], stiffness=50, damping_ratio=-0.1)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.ron"
            with self.assertRaises(sp.SceneError) as caught:
                s.write(path)
            self.assertFalse(path.exists())
        self.assertEqual(caught.exception.spring, 0)
        self.assertIn("damping ratio", str(caught.exception))


if __name__ == "__main__":
    unittest.main()
