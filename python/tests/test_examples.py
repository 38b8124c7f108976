"""The examples run, and come to what they should."""

import contextlib
import importlib.util
import io
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples" / "python"


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def found_by(module, *arguments):
    with contextlib.redirect_stdout(io.StringIO()):
        return module.main(*arguments)


class Examples(unittest.TestCase):
    def test_the_footbridge(self):
        bridge = example("footbridge")
        with tempfile.TemporaryDirectory() as folder:
            found = found_by(bridge, folder)
            picture = ElementTree.parse(Path(folder) / "footbridge.svg")
            self.assertTrue((Path(folder) / "footbridge.html").exists())
        lines = picture.findall(".//{http://www.w3.org/2000/svg}line")
        self.assertEqual(len(lines), 180)
        # Of a parabola under a weight w per length: H = w L^2 / (8 f) in the middle, and
        # H sqrt(1 + (4 f / L)^2) at its ends; that of a polygon is steepest half a bay before.
        weight = (bridge.NODE_MASS + 4) * bridge.GRAVITY / bridge.BAY
        horizontal = weight * bridge.SPAN**2 / (8 * bridge.SAG)
        slope = 4 * bridge.SAG / bridge.SPAN * (1 - bridge.BAY / bridge.SPAN)
        expected = horizontal * (1 + slope**2) ** 0.5
        self.assertAlmostEqual(found["tension at rest"]["cables"] / expected, 1, delta=0.01)
        # At least what a weight in the middle adds, W L / (4 f), to one of two cables.
        people = bridge.WEIGHT * bridge.SPAN / (4 * bridge.SAG)
        self.assertGreater(found["peak"]["cables"], expected + 0.5 * people)
        self.assertLess(found["peak"]["cables"], 3 * expected)
        self.assertGreater(found["peak"]["hangers"], found["tension at rest"]["hangers"])
        self.assertGreater(found["sag"], 0.01)

    def test_the_crawler(self):
        crawler = example("crawler")
        found = found_by(crawler)
        self.assertAlmostEqual(found["place"], crawler.TARGET, delta=0.02)
        self.assertLess(found["arrived"], 10)
        energy = found["energy"]
        # All that the actuators do becomes heat, in them and in the ground.
        heat = energy["dashpot_heat"] - energy["load_work"]
        self.assertAlmostEqual(energy["control_work"], heat + energy["total"], delta=0.02)
        self.assertLess(energy["load_work"], -0.5)


if __name__ == "__main__":
    unittest.main()
