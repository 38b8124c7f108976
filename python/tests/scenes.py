"""Scenes for tests."""

import numpy as np
import springs as sp


def net(n=6):
    """A square net of n x n nodes hung by two corners, with damping and a load."""
    grid = np.arange(n * n).reshape(n, n)
    x = np.zeros((n * n, 3))
    x[:, 0] = np.repeat(np.arange(n), n) / (n - 1)
    x[:, 1] = np.tile(np.arange(n), n) / (n - 1)
    along = np.stack([grid[:-1].ravel(), grid[1:].ravel()], axis=1)
    across = np.stack([grid[:, :-1].ravel(), grid[:, 1:].ravel()], axis=1)
    s = sp.Scene(gravity=(0, 0, -9.81), name="net")
    s.nodes(x, mass=0.3 / n**2)
    s.springs(along, stiffness=200.0, damping=0.05)
    s.springs(across, EA=40.0, damping_ratio=0.02, law="tension-only")
    s.fix([0, n - 1])
    s.load(n * n // 2, force=[(0, 0, 0), (0.1, 0, -0.2)], times=[0.0, 0.5])
    return s


def block(n):
    """A block of n x n x n nodes on its lowest layer, with springs along edges and
    diagonals of cells: long factorizations."""
    at = np.stack(np.meshgrid(*3 * [np.arange(n)], indexing="ij"), axis=-1).reshape(-1, 3)
    grid = np.arange(n**3).reshape(n, n, n)
    pairs = []
    for step in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1)]:
        first = grid[tuple(slice(0, n - d) for d in step)].ravel()
        second = grid[tuple(slice(d, n) for d in step)].ravel()
        pairs.append(np.stack([first, second], axis=1))
    s = sp.Scene(gravity=(0, 0, -9.81), name="block")
    s.nodes(0.1 * at, mass=1e-2)
    s.springs(np.concatenate(pairs), stiffness=2e3)
    s.fix(at[:, 2] == 0)
    return s
