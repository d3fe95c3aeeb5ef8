"""Commands that this package adds to `wakewise`: one module per command."""

from wakewise.ui.cli.commands import PHOTOGRAPHS, STUDIES, CliCommand
from wakewise_paper.cli import photo_robustness, reproduce, wake

COMMANDS = (
    CliCommand(PHOTOGRAPHS, "photo-robustness", photo_robustness.degrade),
    CliCommand(STUDIES, "reproduce", reproduce.reproduce),
    CliCommand("wake", "validate", wake.validate),
    CliCommand("wake", "learn", wake.learn),
    CliCommand("wake", "calibrate-flight", wake.calibrate_flight),
)
