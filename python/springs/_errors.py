"""What is raised."""


class Error(Exception):
    """Anything that goes wrong in springs.

    ``node`` and ``spring`` are indices from 0, ``time`` is in s, ``advice`` says what to do;
    each is None where there is none. ``result`` is what a run came to before.
    """

    def __init__(self, message="", *, node=None, spring=None, time=None, advice=None):
        super().__init__(message)
        self.node = node
        self.spring = spring
        self.time = time
        self.advice = advice
        self.result = None

    def __str__(self):
        message = super().__str__()
        return f"{message}\n  {self.advice}" if self.advice else message


class SceneError(Error, ValueError):
    """A scene, or how it is to be run, is wrong."""


class StepError(Error, ArithmeticError):
    """A simulation cannot go on, or there is no equilibrium."""


class SystemError(Error):
    """A file cannot be read or written, or there is not enough memory."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C stopped a run at ``time``, in s; ``result.resume()`` goes on."""

    def __init__(self, message="", *, time=None):
        super().__init__(message)
        self.time = time
        self.result = None
