"""Many runs of one scene with different numbers in it."""

import csv
import io
import itertools
import json
import os
import tempfile
import threading
import time
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ._errors import Error, SceneError

# Runs that an executor has at most before the first of them is done.
_WINDOW = 256


@dataclass(frozen=True)
class SweepResult:
    """What the runs of a sweep came to, in their order: each value of the last setting with
    the first of the others, and so on. Arrays (r,) by name; of runs that failed, measures
    are NaN and `failures` says why."""

    settings: dict
    measures: dict
    failures: dict

    def __len__(self):
        return len(next(iter(self.settings.values())))


def sweep(scene, settings, *, measure, executor=None, out=None, progress=None, **how):
    """Runs `scene` with every combination of the values of `settings`, such as
    `{"EA": np.logspace(4, 6, 20), "damping_ratio": [0.01, 0.05]}`, by the names of
    `springs sweep --set`.

    `measure` is a name such as "max(tension)" or a list of these (those of `springs sweep
    --measure`), or a function of the result of a run that returns a number or a dict of
    numbers; for processes it must be one that can be pickled. `how` goes to `Scene.run`:
    duration, step, tolerance, method, tangent, and with a function frames.

    `executor` is any `concurrent.futures.Executor`; without one, processes of this machine
    are used, which needs `if __name__ == "__main__":` in scripts. In the folder `out`,
    `results.csv` gets a line for each run that is done, and the same sweep goes on there
    after a stop. Runs that fail are counted, and stop nothing."""
    values = {name: [float(value) for value in np.ravel(column)] for name, column in settings.items()}
    if not values or not all(values.values()):
        raise SceneError("a sweep needs settings, each with values")
    names = [measure] if isinstance(measure, str) else measure
    if callable(names):
        frames = {"frames": how.pop("frames")} if "frames" in how else {}
        task, columns = _Function(names, frames), None
    else:
        task, columns = _Names(list(names)), list(names)
    base = scene.with_settings(**how)
    for name, column in values.items():
        for value in column:
            base.changed_by({name: value})
    runs = list(itertools.product(*values.values()))
    table = _Table(out, base, values, columns)
    left = [run for run in range(len(runs)) if run not in table.rows]

    def scenes():
        for run in left:
            try:
                yield run, base.changed_by(dict(zip(values, runs[run])))
            except Error as error:
                table.add(run, runs[run], None, error.args[0])

    told = _teller(progress, len(runs))
    own = executor is None
    executor = _processes() if own else executor
    waiting = {}
    try:
        for run, changed in scenes():
            waiting[executor.submit(task, changed)] = run
            if len(waiting) >= _WINDOW:
                _collect(waiting, table, runs)
                told(len(table.rows))
        while waiting:
            _collect(waiting, table, runs)
            told(len(table.rows))
    except BaseException:
        for future in waiting:
            future.cancel()
        raise
    finally:
        if own:
            executor.shutdown()
        table.close(len(runs))
    return table.result(values, runs)


def _processes():
    """Processes of this machine, which end when this one is killed."""
    return ProcessPoolExecutor(initializer=_end_with, initargs=(os.getpid(),))


def _end_with(parent):
    # There, the signal 0 is none; and processes end with their parent's job.
    if os.name != "posix":
        return

    def watch():
        while True:
            time.sleep(0.5)
            try:
                os.kill(parent, 0)
            except ProcessLookupError:
                os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _collect(waiting, table, runs):
    """Takes what is done, one run at least."""
    for future in wait(waiting, return_when=FIRST_COMPLETED).done:
        run = waiting.pop(future)
        measured, failure = future.result()
        table.add(run, runs[run], measured, failure)


class _Names:
    """Measures of the library, in the order of their names."""

    def __init__(self, names):
        self.names = names

    def __call__(self, scene):
        try:
            return dict(zip(self.names, scene.measure(self.names))), None
        except Error as error:
            return None, error.args[0]


class _Function:
    """What a function makes of the result of a run."""

    def __init__(self, function, how):
        self.function, self.how = function, how

    def __call__(self, scene):
        try:
            measured = self.function(scene.run(threads=1, **self.how))
        except Error as error:
            return None, error.args[0]
        if not isinstance(measured, dict):
            measured = {"measure": measured}
        return {name: float(value) for name, value in measured.items()}, None


class _Table:
    """The lines of runs by number, and the file that has them, if there is one."""

    def __init__(self, out, base, values, columns):
        self.rows, self.columns, self.values, self.file = {}, columns, values, None
        if out is None:
            return
        out = Path(out)
        out.mkdir(parents=True, exist_ok=True)
        self.path, plan = out / "results.csv", out / "sweep.json"
        with tempfile.TemporaryDirectory() as folder:
            text = Path(folder) / "scene.ron"
            base.write(text)
            scene = text.read_text(encoding="utf-8")
        what = {"scene": scene, "set": values, "measure": columns}
        if plan.exists():
            if json.loads(plan.read_text(encoding="utf-8")) != what:
                raise SceneError(f"`{out}` holds another sweep", advice="choose another folder")
            self._read()
        else:
            _replace(plan, json.dumps(what))
        self.file = open(self.path, "a", encoding="utf-8", newline="")

    def _read(self):
        """The whole lines of the file; half a line at its end is none."""
        if not self.path.exists():
            return
        text = self.path.read_text(encoding="utf-8")
        whole = text[: text.rfind("\n") + 1]
        if whole != text:
            _replace(self.path, whole)
        lines = list(csv.reader(io.StringIO(whole)))
        if lines:
            self.columns = lines[0][1 + len(self.values) : -1]
            for line in lines[1:]:
                self.rows[int(line[0])] = line

    def _header(self):
        return ["run", *self.values, *(self.columns or []), "failure"]

    def add(self, run, values, measured, failure):
        if self.columns is None and measured is not None:
            self.columns = list(measured)
            if self.file and self.rows:
                # Runs that failed before it was known what a function measures.
                self.rows = {run: [*row[:-1], *[""] * len(measured), row[-1]] for run, row in self.rows.items()}
                self._rewrite()
        columns = self.columns or []
        if measured is not None and list(measured) != columns:
            raise SceneError(f"run {run} has the measures {list(measured)}, but others have {columns}")
        numbers = [repr(measured[name]) if measured else "" for name in columns]
        failure = (failure or "").replace("\n", " ")
        self.rows[run] = [str(run), *map(repr, values), *numbers, failure]
        if self.file:
            if len(self.rows) == 1:
                self.file.write(_line(self._header()))
            self.file.write(_line(self.rows[run]))
            self.file.flush()

    def _text(self):
        rows = [self._header(), *(self.rows[run] for run in sorted(self.rows))]
        return "".join(map(_line, rows))

    def _rewrite(self):
        self.file.close()
        _replace(self.path, self._text())
        self.file = open(self.path, "a", encoding="utf-8", newline="")

    def close(self, n):
        """In the order of the runs, if all are there."""
        if self.file:
            self.file.close()
            if len(self.rows) == n:
                _replace(self.path, self._text())

    def result(self, values, runs):
        columns = self.columns or []
        first = 1 + len(values)
        number = lambda text: float(text) if text else np.nan
        rows = [self.rows[run] for run in range(len(runs))]
        measures = {
            name: np.array([number(row[first + k]) for row in rows]) for k, name in enumerate(columns)
        }
        settings = {name: np.array([run[k] for run in runs]) for k, name in enumerate(values)}
        failures = {run: row[-1] for run, row in enumerate(rows) if row[-1]}
        return SweepResult(settings, measures, failures)


def _line(fields):
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(fields)
    return text.getvalue()


def _replace(path, text):
    """Writes a file that is there whole or not at all."""
    handle, draft = tempfile.mkstemp(dir=path.parent, prefix=".springs-")
    with os.fdopen(handle, "w", encoding="utf-8", newline="") as file:
        file.write(text)
    os.replace(draft, path)


def _teller(progress, n):
    """Who is told how many runs are there."""
    if not progress:
        return lambda done: None
    if progress is True:
        from ._progress import bar

        progress = bar()
    return lambda done: progress(done / n)
