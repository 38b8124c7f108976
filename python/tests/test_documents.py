"""The Python lines of the README and the guide, and the docstrings, run as they are."""

import doctest
import os
import re
import tempfile
import unittest
from pathlib import Path

import springs

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs/guide/src").glob("*.md"))]


class Documentation(unittest.TestCase):
    def test_the_documents_run(self):
        runs = 0
        before = os.getcwd()
        for document in DOCUMENTS:
            blocks = re.findall(r"```python\n(.*?)```", document.read_text(), re.DOTALL)
            with tempfile.TemporaryDirectory() as folder:
                os.chdir(folder)
                os.mkdir("target")
                names = {}
                try:
                    for block in blocks:
                        exec(compile(block, str(document), "exec"), names)
                        runs += 1
                finally:
                    os.chdir(before)
            if "sim" in names:
                self.assertEqual(len(names["sim"].x), names["n"])
        self.assertGreater(runs, 1)

    def test_docstrings_run(self):
        results = doctest.testmod(springs)
        self.assertGreater(results.attempted, 0)
        self.assertEqual(results.failed, 0)


if __name__ == "__main__":
    unittest.main()
