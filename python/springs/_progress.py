"""A bar for the progress of a run."""

import sys


def bar():
    """A function of the part that is done, from 0 to 1, which draws a bar: that of tqdm if
    it is there, else one on standard error, if that is a terminal."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return _plain()
    drawn = tqdm(total=1.0, bar_format="{percentage:3.0f}%|{bar}| {elapsed} < {remaining}")

    def draw(done):
        drawn.update(done - drawn.n)
        if done >= 1.0:
            drawn.close()

    return draw


def _plain():
    if not sys.stderr.isatty():
        return lambda done: None

    def draw(done):
        width = 32
        full = round(width * done)
        end = "\n" if done >= 1.0 else ""
        sys.stderr.write(f"\r{'#' * full}{'.' * (width - full)} {100 * done:3.0f} %{end}")
        sys.stderr.flush()

    return draw
