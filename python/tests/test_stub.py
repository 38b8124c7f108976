"""The stub has what the module has."""

import ast
import inspect
import sys
import unittest
from pathlib import Path

import springs
from springs import _springs

STUB = Path(springs.__file__).with_name("_springs.pyi")


def parameters(function):
    """Names and kinds of a function of the stub, without what the object itself is."""
    a = function.args
    names = [(arg.arg, "any") for arg in a.posonlyargs + a.args]
    names += [(arg.arg, "keyword") for arg in a.kwonlyargs]
    is_static = any(getattr(d, "id", "") == "staticmethod" for d in function.decorator_list)
    return names if is_static or not names or names[0][0] not in ("self", "cls") else names[1:]


def of_module(thing):
    found = inspect.signature(thing).parameters.values()
    keyword = inspect.Parameter.KEYWORD_ONLY
    names = [(p.name, "keyword" if p.kind == keyword else "any") for p in found]
    return [pair for pair in names if pair[0] not in ("self", "cls")]


class Stub(unittest.TestCase):
    def test_it_is_complete(self):
        stub = ast.parse(STUB.read_text())
        classes = {node.name: node for node in stub.body if isinstance(node, ast.ClassDef)}
        functions = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef)}
        public = {name for name, _ in inspect.getmembers(_springs) if not name.startswith("__")}
        self.assertEqual(public, set(classes) | set(functions))
        for name, function in functions.items():
            self.assertEqual(parameters(function), of_module(getattr(_springs, name)), name)
        for name, node in classes.items():
            self.of_class(getattr(_springs, name), node)

    def of_class(self, thing, node):
        self.assertEqual(thing.__module__, "springs")
        self.assertTrue(thing.__doc__)
        said = {item.name: item for item in node.body}
        public = {name for name in vars(thing) if not name.startswith("_")}
        self.assertEqual(public, {name for name in said if not name.startswith("_")}, thing)
        for name, item in said.items():
            decorators = item.decorator_list
            is_property = any(getattr(d, "attr", getattr(d, "id", "")) in ("property", "setter") for d in decorators)
            member = inspect.getattr_static(thing, name)
            self.assertEqual(inspect.isdatadescriptor(member), is_property, name)
            if not name.startswith("_"):
                self.assertTrue(member.__doc__, f"{thing.__name__}.{name} has no documentation")
            if name == "__new__":
                # Python 3.9 does not tell those of classes.
                if sys.version_info >= (3, 10):
                    self.assertEqual(parameters(item), of_module(thing))
            elif not is_property:
                self.assertEqual(parameters(item), of_module(getattr(thing, name)), name)


if __name__ == "__main__":
    unittest.main()
