"""The README's Python lines and the docstrings run as they are."""

import doctest
import os
import re
import tempfile
import unittest
from pathlib import Path

import springs

README = Path(__file__).parents[2] / "README.md"


class Documentation(unittest.TestCase):
    def test_the_readme_runs(self):
        blocks = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
        self.assertTrue(blocks)
        before = os.getcwd()
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            os.mkdir("target")
            try:
                for block in blocks:
                    names = {}
                    exec(compile(block, str(README), "exec"), names)
                    self.assertEqual(len(names["sim"].x), names["n"])
            finally:
                os.chdir(before)

    def test_docstrings_run(self):
        results = doctest.testmod(springs)
        self.assertGreater(results.attempted, 0)
        self.assertEqual(results.failed, 0)


if __name__ == "__main__":
    unittest.main()
