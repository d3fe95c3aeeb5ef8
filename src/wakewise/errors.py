"""The exceptions that Wakewise raises; the command line turns them into one line and exit code 2."""


class WakewiseError(Exception):
    """Base of every error that Wakewise raises on purpose."""


class InputError(WakewiseError):
    """What the user gave cannot be used: the message names the file or field, what was found and what is allowed."""


class StageError(WakewiseError):
    """A stage of a trial could not finish on valid input, such as photographs that do not register."""


class EnvironmentFailure(WakewiseError):  # noqa: N818  (no error of the program)
    """The computer did not let a stage finish: a full disk, no permission, a file that went away.

    Says nothing about the input, so no result is made of it: the same command, given room, does the stage again.
    """


class MissingExtra(WakewiseError, ImportError):  # noqa: N818  (it is what is missing, as pip names it)
    """A package is needed that is no part of the core: the message says by whom, which, and how it is installed."""
