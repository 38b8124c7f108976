"""What Python adds to steps: 1e5 steps of a scene of 100 nodes from Python and from the
command line, `advance` of one step, with and without a change of all rest lengths, and which
part of a closed loop is stepping. Processor times in s, the least of several, those of the
command line with its start and end.

    python benches/python.py target/release/springs
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import springs as sp

STEPS = 100_000
STEP = 1e-3
REPEATS = 3


def net(n=10):
    """A net of n x n nodes hung by two corners."""
    grid = np.arange(n * n).reshape(n, n)
    x = np.zeros((n * n, 3))
    x[:, 0] = np.repeat(np.arange(n), n)
    x[:, 1] = np.tile(np.arange(n), n)
    s = sp.Scene(gravity=(0, 0, -9.81))
    s.nodes(x, mass=0.1)
    for first, second in [(grid[:-1], grid[1:]), (grid[:, :-1], grid[:, 1:])]:
        pairs = np.stack([first.ravel(), second.ravel()], axis=1)
        s.springs(pairs, stiffness=500.0)
    s.fix([0, n - 1])
    return s


def least(measure):
    return min(measure() for _ in range(REPEATS))


def main():
    program = sys.argv[1]
    s = net()
    for method in ["velocity-verlet", "linearly-implicit-euler"]:
        how = {"step": STEP, "method": method}

        def python():
            begin = time.process_time()
            s.run(STEPS * STEP, frames=1, threads=1, **how)
            return time.process_time() - begin

        def command_line():
            with tempfile.TemporaryDirectory() as folder:
                scene, out = Path(folder) / "net.ron", Path(folder) / "out"
                s.write(scene)
                command = [program, "run", scene, "--out", out, "--quiet", "--frames", "1"]
                command += ["--step", str(STEP), "--duration", str(STEPS * STEP)]
                command += ["--method", method, "--write", "npz", "--threads", "1"]
                begin = resource.getrusage(resource.RUSAGE_CHILDREN)
                subprocess.run(command, check=True)
                end = resource.getrusage(resource.RUSAGE_CHILDREN)
                return end.ru_utime + end.ru_stime - begin.ru_utime - begin.ru_stime

        def alternating():
            pairs = [(python(), command_line()) for _ in range(REPEATS)]
            return [min(times) for times in zip(*pairs)]

        ours, theirs = alternating()
        sim = s.simulation(threads=1, **how)

        def at_once():
            begin = time.process_time()
            sim.advance(10_000 * STEP)
            return (time.process_time() - begin) / 10_000

        def one_by_one():
            begin = time.process_time()
            for _ in range(10_000):
                sim.advance(STEP)
            return (time.process_time() - begin) / 10_000

        rest = sim.rest_length

        def changing():
            begin = time.process_time()
            for k in range(10_000):
                sim.rest_length = rest * (1 + 1e-4 * (k % 2))
                sim.advance(STEP)
            return (time.process_time() - begin) / 10_000

        inside, single, changed = least(at_once), least(one_by_one), least(changing)
        print(
            f"{method}: {STEPS} steps {ours:.3f} s, command line {theirs:.3f} s "
            f"({100 * (ours / theirs - 1):+.1f} %); a step {1e6 * inside:.2f} us, "
            f"advance of one {1e6 * (single - inside):+.2f} us, "
            f"with other rest lengths {1e6 * (changed - inside):+.2f} us"
        )
    closed_loop(s)


def closed_loop(s):
    """A loop as in the guide: reads x and v, sets all rest lengths, and makes four steps, 60 times
    a simulated second."""
    sim = s.simulation(step=1 / 240, method="tr-bdf2", threads=1)
    rest = sim.rest_length
    seconds = {"reading": 0.0, "policy": 0.0, "changes": 0.0, "steps": 0.0}

    def timed(name, work):
        begin = time.process_time()
        result = work()
        seconds[name] += time.process_time() - begin
        return result

    for _ in range(600):
        x, v = timed("reading", lambda: (sim.x, sim.v))
        factor = timed("policy", lambda: 1 + 0.01 * np.tanh(x[1:2, 2] + v[1:2, 2]))
        timed("changes", lambda: setattr(sim, "rest_length", rest * factor))
        timed("steps", lambda: sim.advance(1 / 60))
    total = sum(seconds.values())
    shares = ", ".join(f"{name} {100 * one / total:.1f} %" for name, one in seconds.items())
    print(f"closed loop, tr-bdf2: {1e6 * total / 600:.0f} us a turn of four steps: {shares}")


if __name__ == "__main__":
    main()
