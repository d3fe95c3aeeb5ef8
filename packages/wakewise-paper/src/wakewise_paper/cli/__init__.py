"""Commands that this package adds to `wakewise`: one module per command."""

from wakewise.ui.cli.commands import PHOTOGRAPHS, STUDIES, Command
from wakewise_paper.cli import photo_robustness, reproduce, wake

COMMANDS = (
    Command(PHOTOGRAPHS, "photo-robustness", photo_robustness.degrade),
    Command(STUDIES, "reproduce", reproduce.reproduce),
    Command("wake", "validate", wake.validate),
    Command("wake", "learn", wake.learn),
    Command("wake", "calibrate-flight", wake.calibrate_flight),
)
