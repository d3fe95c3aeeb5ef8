"""What parts the columns of a table that somebody wrote: commas are read, and another sign is named in the refusal."""

from __future__ import annotations

from collections.abc import Iterable


def other_separator(names: Iterable[str] | None) -> str:
    """What to add to a message about a table's columns: the sign that parts them if it is no comma, else nothing.

    Parameters
    ----------
    names : iterable of str, or None
        The first line, as parted by commas.
    """
    line = ",".join(names or ())
    for sign, word in ((";", "semicolons"), ("\t", "tabs")):
        if sign in line:
            return f" (its columns are parted by {word}, commas are needed)"
    return ""
