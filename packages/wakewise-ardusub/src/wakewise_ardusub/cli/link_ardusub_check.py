"""`wakewise link ardusub --check` and `--motor-test`: checks before a vehicle is driven."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli.console import ProgressBars, print_json, print_table

if TYPE_CHECKING:
    from wakewise_ardusub.link.checks import Answer, CheckInputs, CheckResult, MotorResults
    from wakewise_ardusub.link.connection import Connection
    from wakewise_ardusub.link.motor_test import MotorTestStep

Check = Annotated[
    bool,
    typer.Option(
        "--check",
        help="Only say whether this vehicle may be driven: its motors, mixer, firmware, script, failsafes and what is "
        "heard, go or no-go line by line. Ends with 1 if not, with 2 if nobody has seen the motors turn.",
    ),
]
Params = Annotated[
    Path | None,
    typer.Option(
        "--params",
        metavar="FILE",
        help="Check a ground station's parameter file instead of a vehicle; what needs a connection stays unknown.",
        show_default=False,
    ),
]
MotorTest = Annotated[
    bool,
    typer.Option("--motor-test", help="Only turn motor by motor, each with your consent, and keep what you saw."),
]
Motors = Annotated[
    str | None,
    typer.Option("--motors", metavar="N,...", help="Motors of --motor-test; all if not given.", show_default=False),
]
Results = Annotated[
    Path,
    typer.Option(
        "--motor-results", metavar="FILE", help="Where --motor-test keeps what was seen and --check reads it."
    ),
]
Untested = Annotated[
    bool,
    typer.Option("--without-motor-test", help="Let --check say go although nobody has seen the motors turn."),
]
DEFAULT_MOTOR_RESULTS = Path("runs/motor-test.json")
_MARKS = {"go": "[green]go[/]", "no-go": "[bold red]no-go[/]", "unknown": "[yellow]?[/]"}


def check_vehicle(
    connection: str,
    vehicle: str,
    system: int,
    params: Path | None,
    motor_results: Path,
    *,
    buttons: Mapping[str, int],
    untested: bool,
    json: bool,
) -> None:
    """Print every row and the verdict; end with 1 unless it is go, with 2 where motors were not seen to turn."""
    from wakewise.robot.importers import any_vehicle
    from wakewise_ardusub.link.checks import CheckInputs, check, read_results, verdict
    from wakewise_ardusub.link.parameters import read_parameter_file
    from wakewise_ardusub.link.vehicle_survey import survey

    chosen = any_vehicle(vehicle)
    results = read_results(motor_results) if motor_results.exists() else None
    if params is not None:
        parameters = read_parameter_file(params)
        facts = CheckInputs(vehicle=chosen, parameters=parameters, system=system, results=results, buttons=buttons)
    else:
        with _connected(connection, system, "--check") as link, ProgressBars().stage("asking") as advance:
            facts = survey(link, chosen, results=results, buttons=buttons, progress=advance)
    rows = check(facts)
    said = verdict(rows, motors_seen=not untested)
    if json:
        where = {"params": str(params)} if params is not None else {"connection": connection}
        print_json({"verdict": said, "vehicle": chosen.name, **where, "rows": [asdict(row) for row in rows]})
    else:
        _show(rows, said, facts)
    if said != "go":
        raise typer.Exit(2 if said == "unseen" else 1)


def test_vehicle_motors(
    connection: str, vehicle: str, system: int, motors: str | None, motor_results: Path, *, json: bool
) -> None:
    """Turn motors one by one with the operator's consent, and keep what was seen."""
    from wakewise.robot.importers import any_vehicle
    from wakewise_ardusub.link.checks import read_results, write_results
    from wakewise_ardusub.link.motor_test import chosen_motors, planned_turns, run_motor_test
    from wakewise_ardusub.link.parameters import read_parameters
    from wakewise_ardusub.link.vehicle_survey import await_autopilot

    chosen = any_vehicle(vehicle)
    numbers = chosen_motors(chosen, _motor_numbers(motors))
    before = read_results(motor_results) if motor_results.exists() else None
    with _connected(connection, system, "--motor-test") as link:
        await_autopilot(link)
        with ProgressBars().stage("parameters") as advance:
            turns = planned_turns(chosen, read_parameters(link, progress=advance), numbers)
        _say(
            f"{len(turns)} motors of {chosen.title} turn one by one for 1.5 s. Put it in water or hold it fast, with "
            "nobody's hands near; Ctrl-C stops. After each motor ArduSub disarms itself."
        )
        results = run_motor_test(
            link,
            chosen,
            turns,
            _ConsoleOperator(),
            keep=lambda found: write_results(motor_results, _with_those_before(found, before)),
        )
    if json:
        print_json({"file": str(motor_results), "motors": [asdict(seen) for seen in results.seen.values()]})
        return
    for seen in results.seen.values():
        mended = seen.right_direction
        advice = f": set MOT_{seen.motor}_DIRECTION to {mended:g}" if mended not in (None, seen.direction) else ""
        typer.echo(f"motor {seen.motor:<2} {seen.answer}{advice}")
    typer.echo(f"kept in {motor_results}, which --check reads")


class _ConsoleOperator:
    """Who sits at the terminal; implements `wakewise_ardusub.link.motor_test.Operator`."""

    def consents(self, turn: MotorTestStep) -> bool:
        _say(
            f"\nmotor {turn.motor} ({turn.name}), {turn.pulse_us} us: pushes the vehicle {turn.expected}; its water "
            "goes the other way"
        )
        return typer.confirm("turn it now?", default=False, err=True)

    def saw(self, turn: MotorTestStep) -> Answer:
        from wakewise_ardusub.link.checks import ANSWERS

        letters: dict[str, Answer] = dict(zip("yonx", ANSWERS, strict=False))
        words = f"pushed {turn.expected}? y: yes, o: the other way, n: another motor turned, x: nothing turned"
        while True:
            typed = typer.prompt(words, err=True).strip().lower()
            if typed in letters:
                return letters[typed]

    def arms(self, why: str) -> None:
        _say(f"arm the vehicle from your ground station ({why})")
        typer.prompt("Enter when it is armed", default="", show_default=False, err=True)


def _with_those_before(results: MotorResults, before: MotorResults | None) -> MotorResults:
    """Motors that were not asked now keep what was seen of them before, if it was this vehicle."""
    from dataclasses import replace

    if before is None or before.vehicle != results.vehicle:
        return results
    fresh = {motor: seen for motor, seen in results.seen.items() if seen.answer != "not asked"}
    return replace(results, seen=dict(sorted({**results.seen, **before.seen, **fresh}.items())))


def _connected(connection: str, system: int, option: str) -> Connection:
    from wakewise.core.errors import InputError
    from wakewise_ardusub.link.connection import Connection, parse_connection

    endpoint = parse_connection(connection)
    if endpoint.way == "file":
        raise InputError(f"{option} asks the vehicle, and {connection} is a file; --params checks a parameter file")
    return Connection(endpoint, system)


def _motor_numbers(motors: str | None) -> list[int] | None:
    from wakewise.core.errors import InputError

    if motors is None:
        return None
    parts = [part.strip() for part in motors.split(",")]
    if not all(part.isascii() and part.isdigit() for part in parts) or len(set(parts)) != len(parts):
        raise InputError(f"--motors {motors!r}: must be different numbers from 1, separated by commas, such as 1,3")
    return [int(part) for part in parts]


def _show(rows: tuple[CheckResult, ...], said: str, facts: CheckInputs) -> None:
    from rich.text import Text

    cells = [(Text.from_markup(_MARKS[row.verdict]), row.what, row.asked, row.found, row.do) for row in rows]
    columns = ("", "what", "asked for", "found", "what to do")
    print_table("t", columns, cells, f"{facts.vehicle.title}: may it be driven motor by motor?")
    wrong = sum(row.verdict == "no-go" for row in rows)
    open_rows = sum(row.verdict == "unknown" and row.needed for row in rows)
    rest = "" if facts.heard is not None else ", as far as parameters say: what is heard needs a connection"
    if said == "go":
        typer.echo(f"go{rest}")
    elif said == "unseen":
        typer.echo(
            f"go{rest}, but nobody has seen {_unseen(rows)} turn; one wired the wrong way round shows nowhere else: "
            "--motor-test, or --without-motor-test to accept it"
        )
    else:
        typer.echo(f"no-go: {wrong} wrong, {open_rows} not known")


def _unseen(rows: tuple[CheckResult, ...]) -> str:
    numbers = [row.what.removeprefix("motor ").removesuffix(" seen") for row in rows if row.unseen]
    return "the motors" if numbers == ["motors"] else f"motor {', '.join(numbers)}"


def _say(words: Any) -> None:
    typer.echo(words, err=True)
