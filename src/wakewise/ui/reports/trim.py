"""What a flight proposes for the ballast of the next one, on its page."""

from __future__ import annotations

from html import escape

from wakewise.core.errors import InputError
from wakewise.operation.flight_trim import ballast_proposal
from wakewise.ui.reports.trial import Trial


def trim_html(trial: Trial) -> str:
    """A sentence, or nothing where the hover says nothing or there is nothing to change."""
    if trial.settings is None or trial.steps is None:
        return ""
    try:
        said = ballast_proposal(trial.settings.parts().vehicle, trial.steps)
    except InputError:  # the vehicle was given in Python
        return ""
    return "" if said is None else f"<p>Before the next flight: {escape(said)}.</p>"
