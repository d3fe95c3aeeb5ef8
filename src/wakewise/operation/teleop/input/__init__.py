"""Inputs of an operator, from any device.

`controls.py` is the record of all inputs; it comes from a script (`script.py`), a trace (`control_log.py`) or a gamepad
(`gamepad.py`, the only module that knows SDL, and `pad_mapping.py`); `script.py` reads script and trace. Keys are read
by the cockpit's page (`ui/cockpit/page/keyboard.js`). The model of an operator is `wakewise.control.operator_model`.
"""

from wakewise.operation.teleop.input.controls import ACTIONS, CENTRED, CONTROL_AXES, Controls, ControlSource

__all__ = [
    "ACTIONS",
    "CENTRED",
    "CONTROL_AXES",
    "ControlSource",
    "Controls",
]
