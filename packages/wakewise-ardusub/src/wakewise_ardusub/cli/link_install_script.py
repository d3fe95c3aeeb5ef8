"""`wakewise link install-script`: put the Lua script for motor control on an autopilot, or into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wakewise.ui.cli.console import ProgressBars, print_json
from wakewise.ui.cli.options import Json


def install_script(
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write wakewise.lua and wakewise.params there.")
    ] = None,
    upload: Annotated[
        str | None,
        typer.Option(
            metavar="CONNECTION",
            help="Put the script on the autopilot by MAVLink, such as udpin:0.0.0.0:14560; it is read back.",
        ),
    ] = None,
    start: Annotated[
        bool,
        typer.Option(
            "--start", help="With --upload: also set SCR_ENABLE to 1 and reboot the autopilot, if it is disarmed."
        ),
    ] = False,
    sitl: Annotated[
        bool, typer.Option("--sitl", help="With --out: also write sitl.params, for --defaults of ArduSub's simulator.")
    ] = False,
    system: Annotated[int, typer.Option(min=1, max=255, help="The vehicle's MAVLink system id.")] = 1,
    params: Annotated[
        bool, typer.Option("--params", help="Print what the autopilot is to be set to, and why.")
    ] = False,
    json: Json = False,
) -> None:
    """Put the script that drives each motor on an ArduSub autopilot, or write it for doing so by hand.

    Without options says what to do by hand. The script starts with the autopilot's next boot, switched off.
    """
    from wakewise.core.errors import InputError
    from wakewise_ardusub.link.protocol import ENABLE_PARAMETER, SCRIPT_VERSION
    from wakewise_ardusub.link.script import BY_HAND, parameters_text, write_parameters, write_script, write_sitl

    if start and upload is None:
        raise InputError("--start: of the autopilot that --upload CONNECTION reaches")
    if sitl and out is None:
        raise InputError("--sitl: writes sitl.params into the folder that --out DIR names")
    if params and (out is not None or upload is not None):
        raise InputError(
            "--params: prints what --out writes into wakewise.params, and goes with neither it nor --upload"
        )
    if params and not json:
        typer.echo(parameters_text(), nl=False)
        return
    written: list[str] = []
    uploaded: str | None = None
    if upload is not None:
        uploaded = _uploaded(upload, system, start=start)
    if out is not None:
        written = [str(write_script(out)), str(write_parameters(out)), *([str(write_sitl(out))] if sitl else [])]
    if json:
        facts = {"version": SCRIPT_VERSION, "uploaded": uploaded, "written": written}
        print_json(facts | ({"params": parameters_text()} if params else {}))
        return
    for path in written:
        typer.echo(f"written   {path}")
    if uploaded is not None:
        typer.echo(f"uploaded  {uploaded} (version {SCRIPT_VERSION}), read back and the same")
        done = "SCR_ENABLE is 1, and the autopilot reboots"
        typer.echo(f"next      {done if start else 'set SCR_ENABLE to 1 if it is not, and reboot the autopilot'}")
    else:
        if not written:
            typer.echo("wakewise link install-script --upload udpin:0.0.0.0:14560 puts it on the autopilot; by hand:")
            typer.echo("0. wakewise link install-script --out .")
        for i, step in enumerate(BY_HAND, start=1):
            typer.echo(f"{i}. {step}")
    typer.echo(
        f"then      {ENABLE_PARAMETER} = 1 allows it to drive, until the next boot; wakewise link ardusub --check"
    )


def _uploaded(connection: str, system: int, *, start: bool) -> str:
    from wakewise.core.errors import InputError
    from wakewise_ardusub.link.connection import Connection, parse_connection
    from wakewise_ardusub.link.script import script_text
    from wakewise_ardusub.link.upload import start_script, upload_script
    from wakewise_ardusub.link.vehicle_survey import await_autopilot

    endpoint = parse_connection(connection, "--upload")
    if endpoint.way == "file":
        raise InputError(f"--upload {connection}: a log is no vehicle; --out writes the script into a folder")
    with Connection(endpoint, system) as link:
        await_autopilot(link)
        with ProgressBars().stage("upload") as advance:
            path = upload_script(link, script_text().encode("utf-8"), progress=advance)
        if start:
            start_script(link)
    return path
