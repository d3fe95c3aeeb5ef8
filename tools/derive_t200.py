"""Derive the small T200 table that ships with Wakewise from the maker's full one.

    python tools/derive_t200.py t200_all_voltages.csv src/wakewise/robot/thrusters/data/t200.csv

Blue Robotics publishes about 200 rows at each of five voltages. Here each direction at each voltage becomes a line
through `KNOTS` knots, which are the least-squares fit to all its readings, with the first and the last one held.
"""

import sys
from pathlib import Path

import numpy as np

from wakewise.core.files import write_text
from wakewise.robot.thrusters.thrust_table import parse_rows

KNOTS = 12
HEADER = """\
# Blue Robotics, T200 thruster: public performance data of September 2019, bollard pull, Basic ESC.
# Derived: least-squares line through 12 knots in each direction at each voltage, by tools/derive_t200.py.
supply_V,pwm_us,rpm,thrust_N,power_W
"""


def fitted(pulse: np.ndarray, values: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Values at `knots` of the line that fits best, its two ends held at the readings there."""
    known = np.isfinite(values)
    pulse, values = pulse[known], values[known]
    hats = np.stack([np.interp(pulse, knots, unit) for unit in np.eye(knots.size)], axis=1)
    ends = np.array([values[0], values[-1]])
    inner = np.linalg.lstsq(hats[:, 1:-1], values - hats[:, [0, -1]] @ ends, rcond=None)[0]
    return np.concatenate([ends[:1], inner, ends[1:]])


def main(source: Path, target: Path) -> None:
    """Write the small table."""
    rows = parse_rows(source.read_text("utf-8"))
    lines = []
    for voltage in np.unique(rows.supply_V):
        at = rows.supply_V == voltage
        pulse, columns = rows.pwm_us[at], np.stack([rows.rpm, rows.thrust_N, rows.power_W])[:, at]
        order = np.argsort(pulse)
        pulse, columns = pulse[order], columns[:, order]
        silent = pulse[columns[1] == 0.0]
        table = [(edge, 0.0, 0.0, 0.0) for edge in (silent[0], silent[-1])]
        for side in (pulse < silent[0], pulse > silent[-1]):
            knots = np.round(np.linspace(pulse[side][0], pulse[side][-1], KNOTS))
            fits = [fitted(pulse[side], column[side], knots) for column in columns]
            table += list(zip(knots, *fits, strict=True))
        lines += [f"{voltage:g},{p:.0f},{n:.0f},{thrust:.2f},{power:.1f}" for p, n, thrust, power in sorted(table)]
    write_text(target, HEADER + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
