# SPDX-License-Identifier: Apache-2.0
"""The main job as one command: a drive on a bus is identified while it runs, and a person sees it."""
import argparse
import os
import secrets
import subprocess
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
RUN_IN_CAN = TOP / "tools" / "vcan" / "run"


def options(arguments):
    parser = argparse.ArgumentParser(prog="tools/run", description=__doc__, epilog=(
        "Exit code 0 only if every true value lies within three half-widths of its 95 %% interval and within 5 %% of the estimate, and if the "
        "effect that is switched on at the end is noticed, named from the record, and its error falls once it is in the model."))
    parser.add_argument("--bus", choices=["auto", "vcan", "uml", "modbus"], default="auto",
                        help="vcan: this kernel's; uml: vcan inside the user-mode-linux machine; modbus: Modbus TCP on loopback; auto: the first that works")
    parser.add_argument("--seed", type=int, help="repeat a run: drive, motion and noise are drawn from it (default: fresh)")
    parser.add_argument("--seconds", type=float, default=40, help="longest wait for the parameters in each act (default 40)")
    parser.add_argument("--record", type=Path, help="CSV record to replay as frames (default: EMPS where ../shared/data has it, else the shipped one)")
    parser.add_argument("--no-setup", action="store_true", help="what tools/setup built is taken as it is")
    parser.add_argument("--inside", choices=["vcan", "modbus"], help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def choose_bus(wanted):
    """Bus and the sentence that says why."""
    if wanted == "modbus":
        return "modbus", "asked for"
    done = subprocess.run([RUN_IN_CAN, "--which"], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    found = done.stdout.strip()
    if wanted == "uml":
        return "uml", "asked for"
    if wanted == "vcan":
        if found != "native":
            sys.exit("tools/run: --bus vcan: this kernel has no vcan (try --bus uml, or modprobe vcan as root)")
        return "vcan", "asked for"
    if found == "native":
        return "vcan", "this kernel has vcan"
    if found == "uml":
        return "uml", "this kernel has no vcan, the user-mode-linux machine has"
    return "modbus", "neither this kernel nor a user-mode-linux machine offers vcan here"


def main(arguments):
    given = options(arguments)
    if given.inside:
        import acts
        return acts.play(given)
    if given.seed is None:
        given.seed = secrets.randbelow(10**6)
    bus, why = choose_bus(given.bus)
    print(f"bus: {bus} ({why})\nseed: {given.seed} (repeat with: tools/run --bus {bus} --seed {given.seed})", flush=True)
    command = [sys.executable, str(Path(__file__).parent), "--inside", "modbus" if bus == "modbus" else "vcan", "--seed", str(given.seed), "--seconds", str(given.seconds)]
    if given.record:
        command += ["--record", str(given.record.resolve())]
    env = {**os.environ, "DRIVEID_LIVE": "1" if sys.stdout.isatty() else "0"}
    if sys.stdout.isatty():
        env["COLUMNS"], env["LINES"] = map(str, os.get_terminal_size())
    if bus != "modbus":
        command = [str(RUN_IN_CAN), "--uml" if bus == "uml" else "--native", "--time", str(int(10 * given.seconds + 500)), *command]
    os.chdir(TOP)
    os.execve(command[0], command, env)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
