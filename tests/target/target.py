# SPDX-License-Identifier: Apache-2.0
"""Build the amalgamated core for Cortex-M, run it under qemu, and measure it.

    python tests/target/target.py     writes docs/target.md and the table in README.md
"""
import functools
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
TOP = HERE.parent.parent
FLAGS = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections"]
CPUS = {"Cortex-M4F": ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"], "Cortex-M0+": ["-mcpu=cortex-m0plus", "-mthumb"]}
# one equation of a few parameters, for 16 KiB of memory
SMALL = {"DRIVEID_THETA_MAX": 4, "DRIVEID_EQUATIONS_MAX": 1, "DRIVEID_CHANNELS_MAX": 4, "DRIVEID_TERMS_MAX": 6, "DRIVEID_Q31_POOL": 320, "DRIVEID_Q31_RING": 256,
         "DRIVEID_Q31_WEIGHTS": 512, "DRIVEID_SOLVE_MAX": 6, "RUN_BYTES": 9216}
METHODS = ("fsm", "rls", "window", "discrete")
TONE_BYTES = 11264  # of method frequency: amplitudes beside the small state
BEGIN, END = "<!-- made by tests/target/target.py -->\n", "<!-- end -->\n"
QEMU = ["qemu-system-arm", "-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"]


def call(command, **more):
    done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=300, **more)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done


def amalgamate(folder):
    call([TOP / "tools/amalgamate", folder])
    return Path(folder)


def defines(values):
    return [f"-D{name}={value}" for name, value in values.items()]


def compile_core(folder, cpu, values=()):
    """Object file of the core, and the stack of each function in bytes."""
    return compiled(folder, cpu, tuple(dict(values).items()))


@functools.cache
def compiled(folder, cpu, items):
    values = dict(items)
    core = folder / f"core{abs(hash((cpu, *values.items())))}.o"
    call(["arm-none-eabi-gcc", *CPUS[cpu], *FLAGS, *defines(values), "-fstack-usage", "-c", folder / "driveid.c", "-o", core])
    rows = [line.split("\t") for line in core.with_suffix(".su").read_text().splitlines()]
    return core, {row[0].split(":")[-1]: int(row[1]) for row in rows}


def link(folder, cpu, core, values=()):
    values = dict(values)
    out = core.with_name(f"run{abs(hash((cpu, str(core), *values.items())))}.elf")
    call(["arm-none-eabi-gcc", *CPUS[cpu], *FLAGS, *defines(values), "--specs=rdimon.specs", "-Wl,--gc-sections,--no-warn-rwx-segments", "-T", HERE / "mps2.ld", f"-I{folder}", HERE / "startup.c",
          HERE / "run.c", core, "-lm", "-o", out])
    return out


def run(elf, *more, board="mps2-an386"):
    return subprocess.run([*QEMU[:2], board, *QEMU[3:], *more, "-kernel", elf], capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=120)


def checks(folder, cpu, core, method, kind, values=(), script="mps2.ld"):
    """Image of the unit checks of one method and type, with no C library's start and no stdio of its own."""
    values = {**dict(values), "RUN_METHOD": f'"{method}"', "RUN_TYPE": f"DRIVEID_{kind}"}
    out = folder / f"checks-{core.stem}-{method}-{kind}.elf"
    call(["arm-none-eabi-gcc", *CPUS[cpu], *FLAGS, *defines(values), "-fno-common", "-nostartfiles", "--specs=nano.specs", "--specs=nosys.specs", "-Wl,--gc-sections,--no-warn-rwx-segments,--no-warnings", "-T", HERE / script,
          f"-I{folder}", HERE / "startup.c", HERE / "checks.c", HERE / "checks_main.c", core, "-lm", "-o", out])
    return out


def host(folder, values=()):
    out = folder / "host"
    call(["cc", *FLAGS, *defines(dict(values)), f"-I{folder}", HERE / "run.c", folder / "driveid.c", "-lm", "-o", out])
    return out


def plugin(folder):
    out = folder / "libcount.so"
    call(["cc", "-O2", "-shared", "-fPIC", HERE / "count.c", "-o", out])
    return out


def instructions(elf, library):
    found = re.search(r"instructions (\d+)", run(elf, "-icount", "shift=10", "-plugin", library).stderr)
    return int(found[1])


def undefined(core):
    return {line.split()[-1] for line in call(["arm-none-eabi-nm", "-u", core]).stdout.splitlines()}


@functools.cache
def calls_of(core):
    """Function -> names that its code refers to."""
    text = call(["arm-none-eabi-objdump", "-dr", core]).stdout
    calls = {}
    for part in re.split(r"\n(?=[0-9a-f]{8} <)", text):
        head = re.match(r"[0-9a-f]{8} <([\w.]+)>:", part)
        if head:
            calls[head[1]] = set(re.findall(r"R_ARM_\w+\s+([\w.]+)", part))
    return calls


def code_of(core, name):
    """Names that a function calls, and those that its callees in this file call."""
    todo, seen = [name], set()
    while todo:
        one = todo.pop()
        if one not in seen:
            seen.add(one)
            todo += calls_of(core).get(one, set())
    return seen


# What an update calls through its method's table; the compiler's files do not show it.
THROUGH_TABLE = {"rls": ("recursive_row_", "recursive_step_", "rls_learn_", "rls_solution_"), "window": ("window_row_", "kernel_step_"), "discrete": ("discrete_row_", "kernel_step_")}


def stack(core, frames, method, kind):
    """Stack of an update in bytes, solve included: frames along the deepest chain of calls; a bound where a table of functions lies between. The C library's own is not in it."""
    def depth(name, above=()):
        if name in above:
            raise RuntimeError(f"{name} calls itself")
        own = frames.get(name, frames.get(re.sub(r"\.\d+$", "", name), 0))
        return own + max((depth(callee, (*above, name)) for callee in calls_of(core).get(name, ()) if callee in calls_of(core)), default=0)

    if method == "frequency":
        return max(depth("tones_follow"), stack(core, frames, "discrete", kind))
    if kind == "Q31":
        return depth("q31_update")
    if method == "fsm":
        return depth("driveid_svf_update_f32")
    return depth("learn_update") + max(depth(f"{name}f32") for name in THROUGH_TABLE[method] if f"{name}f32" in calls_of(core))


def table(folder):
    """Rows: cpu, method, type, state bytes, stack bytes, instructions a sample; of a core: code bytes, largest frame."""
    library = plugin(folder)
    for cpu, types in (("Cortex-M4F", ("F32", "Q31")), ("Cortex-M0+", ("Q31",))):
        sizes = SMALL if cpu == "Cortex-M0+" else {}
        core, frames = compile_core(folder, cpu, {k: v for k, v in sizes.items() if k.startswith("DRIVEID")})
        for method in (*METHODS, "frequency"):
            for kind in types:
                values = {**sizes, **({"RUN_BYTES": TONE_BYTES} if sizes and method == "frequency" else {}), "RUN_METHOD": f'"{method}"', "RUN_TYPE": f"DRIVEID_{kind}"}
                counts = [instructions(link(folder, cpu, core, {**values, "RUN_SAMPLES": n}), library) for n in (900, 1900)]
                state = folder / "state"
                (folder / "state.c").write_text(f'#include <stdio.h>\n#include "driveid.h"\nint main(void) {{ printf("%u\\n", (unsigned)driveid_estimator_size("{method}", DRIVEID_{kind})); return 0; }}\n')
                call(["arm-none-eabi-gcc", *CPUS[cpu], *defines({k: v for k, v in sizes.items() if k.startswith("DRIVEID")}), "--specs=rdimon.specs", "-Wl,--no-warn-rwx-segments", "-T", HERE / "mps2.ld", f"-I{folder}",
                      HERE / "startup.c", folder / "state.c", core, "-lm", "-o", state])
                yield cpu, method, kind.lower(), int(run(state).stdout), stack(core, frames, method, kind), round((counts[1] - counts[0]) / 1000)
        text = call(["arm-none-eabi-size", core]).stdout.splitlines()[1].split()
        yield cpu, "all", "", int(text[0]), max((v, k) for k, v in frames.items()), 0


def rows_of_q31():
    """Signal to error of each kind of row, as the unit test measures and holds it on the host: name -> cells of second derivative, first, value."""
    program = Path(os.environ.get("DRIVEID_BUILD", TOP / "build")) / "tests/unit/fixed_test"
    found = {}
    for name, at, cell in re.findall(r"^\| ([a-z, ]+) \| (\d) \| (.*) \|$", call([program, "--gtest_filter=Fixed.Rows*"]).stdout, re.M):
        found.setdefault(name, {})[at] = cell
    return [f"| {name} | {cells['0']} | {cells['1']} | {cells['2']} |" for name, cells in found.items()]


def write(path):
    with tempfile.TemporaryDirectory() as name:
        folder = amalgamate(name)
        rows = list(table(folder))
    lines = ["# On a microcontroller", "", "Made by `python tests/target/target.py` with Debian's gcc-arm-none-eabi 12.2 (-O2) and qemu's mps2-an386 (the Cortex-M0+ code runs there too). A rigid axis,",
             "two parameters, 1 kHz, 200 rad/s, a solve every 20 ms in f64 (in software on both) included; frequency: one sinusoid up to 100 rad/s. Instructions, not cycles.",
             "`tests/target/checks.c`, the unit checks that the host runs too (values, intervals, status, gaps, rest, restart, alarm, snapshot, saturation), passes on the Cortex-M4F in f32 and q31",
             "and, in q31, on qemu's micro:bit with its 16 KiB of memory: state, stack and checks together.",
             "Cortex-M0+ is built small: " + ", ".join(f"`{k}={v}`" for k, v in SMALL.items() if k.startswith("DRIVEID")) + ".", "",
             "| core | method | type | state, bytes | stack, bytes | instructions a sample |", "|---|---|---|---|---|---|"]
    lines += [f"| {cpu} | {method} | {kind} | {state} | {deep} | {count} |" for cpu, method, kind, state, deep, count in rows if kind]
    lines += ["", "Stack: frames along the deepest chain of calls of an update, solve included, without the C library's own; bounds where a table of functions lies between."]
    lines += ["", "| core | code of all methods and types, bytes | largest frame of a function, bytes |", "|---|---|---|"]
    lines += [f"| {cpu} | {size} | {frame[0]} (`{frame[1]}`) |" for cpu, _, kind, size, frame, _ in rows if not kind]
    lines += ["", "## Fixed point", "", "What q31 refuses, with the reason that `configure` gives (tests/unit/fixed_test.cpp):", "",
              "| method | carries | refused | why |", "|---|---|---|---|",
              "| fsm, rls | up to third derivatives | fourth and higher | the rounding of a filter state comes back (bandwidth/omega)^order larger |",
              "| window, discrete | up to fifth derivatives | sixth | the weights cancel beyond |",
              "| all | a declared range of every channel, one sample time | a channel without range; stamps that jitter by an eighth become a gap | counts need a scale; the coefficients are made once |",
              "| kalman, adm | nothing | always | the covariance, and a filter that grows, need floating point |", "",
              "Rows of q31 against f64 on the same samples (tests/unit/fixed_test.cpp): signal to error, and worst error in units of a row's last bit; measured, and what the test holds:", "",
              "| rows of | second derivative | first derivative | value |", "|---|---|---|---|",
              *rows_of_q31(), "",
              "One and two frequencies (frequency.h) run in q31 too: one by fsm, window and discrete, two, whose equation has a fifth derivative, by window and discrete. The method frequency stands on discrete:",
              "the squares of the frequencies are the same bits on host and target; f itself and the amplitudes are f64 and pass through the C library's atan, sin and cos, so that they agree to 1e-9 (tests/target).", "",
              "Filters, rows and sums of q31 are integers and call no libm (checked in the object code). Two things are f64 with libm, in software where the core has none: the coefficients at",
              "configure, and the solve at the rate of answers (`answer_s`, here every 20 ms); most of the instructions above are its. f32 keeps its sums in f64 as well."]
    Path(path).write_text("\n".join(lines) + "\n")
    return rows


def short(rows):
    """README's table."""
    code = {cpu: size for cpu, _, kind, size, _, _ in rows if not kind}
    lines = ["| core | method | type | state, bytes | stack, bytes | instructions a sample |", "|---|---|---|---|---|---|"]
    lines += [f"| {cpu} | {method} | {kind} | {state} | {deep} | {count} |" for cpu, method, kind, state, deep, count in rows if kind]
    return [*lines, "", "Code of all methods and types: " + ", ".join(f"{size} bytes ({cpu})" for cpu, size in code.items()) + "."]


def readme(rows):
    path = TOP / "README.md"
    text = path.read_text()
    head, rest = text.split(BEGIN)
    path.write_text(head + BEGIN + "\n".join(short(rows)) + "\n" + END + rest.split(END)[1])


if __name__ == "__main__":
    readme(write(TOP / "docs/target.md"))
