"""Commands that this package adds to `wakewise`: `wakewise link ...`, one module per command."""

from wakewise.ui.cli.commands import REAL_VEHICLE, CliCommand
from wakewise_ardusub.cli import link

COMMANDS = (CliCommand(REAL_VEHICLE, "link", link.app),)
