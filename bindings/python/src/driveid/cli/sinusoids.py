# SPDX-License-Identifier: Apache-2.0
"""driveid frequency | excitation | suggest."""

from __future__ import annotations

import click
from rich.table import Table
from rich.text import Text

from .. import _core, shifting, sinusoids
from ..errors import DataError
from ..records import parse_maps, read
from ..views import units
from .common import BAD_DATA, DriveidCommand, invoke_guard, say, stdout_console, write_document


def _document(**more) -> dict:
    return {"format": _core.format, "driveid": _core.version, "model": None, **more}


@click.command(cls=DriveidCommand, spread={"--map": -1})
@click.argument("record", metavar="RECORD")
@click.argument("signal", metavar="SIGNAL")
@click.option("--sinusoids", "count", type=click.IntRange(1, 2), default=1, show_default=True, help="How many there are.")
@click.option("--highest", "highest_rad_s", type=float, metavar="RAD_S", help="The highest angular frequency expected; else the spectrum's peak.")
@click.option("--method", type=click.Choice(sinusoids.METHODS), default="window", show_default=True)
@click.option("--map", "maps", multiple=True, metavar="NAME=COLUMN[:UNIT]", help="What a column is.")
@click.option("--json", "json_file", metavar="FILE", help="Write the whole answer as JSON; - is standard output.")
@click.pass_context
@invoke_guard
def frequency(ctx, record, signal, count, highest_rad_s, method, maps, json_file) -> None:
    """Frequencies of SIGNAL in RECORD: one or two sinusoids with bias (vibration, torque ripple)."""
    data = read(record, map=parse_maps(maps))
    document = _document(records=[{"name": data.name, "rows": data.rows, "span_s": float(data.t_s[-1]), "hash": data.hash, "role": "training"}], notices=[{"kind": "reader", "record": data.name, "text": t} for t in data.notices],
                         signal=signal)
    try:
        found = sinusoids.frequencies(data, signal, count, highest_rad_s=highest_rad_s, method=method)
    except DataError as e:
        write_document(json_file, {**document, "verdict": "bad_data", "message": str(e)})
        say(f"driveid: bad data: {e}")
        ctx.exit(BAD_DATA)
    write_document(json_file, {**document, "frequencies": [{"value": f.omega_rad_s, "interval": list(f.interval), "unit": "rad/s"} for f in found]})
    table = Table("", "omega, 95 % interval", "frequency", "period", box=None, pad_edge=False)
    for k, f in enumerate(found, 1):
        table.add_row(str(k), units.estimate(f.omega_rad_s, *f.interval, "rad/s"), f"{f.f_Hz:.6g} Hz", units.duration(1 / f.f_Hz))
    stdout_console(json_file).print(table)


@click.command()
@click.option("--omega-0", "omega_0_rad_s", type=float, required=True, metavar="RAD_S", help="Natural frequency, as far as it is known.")
@click.option("--zeta", type=float, default=0.02, show_default=True, help="Damping ratio, as far as it is known.")
@click.option("--amplitude", type=float, default=1.0, show_default=True, help="Of the acceleration: force over mass, torque over inertia.")
@click.option("--sigma", type=float, required=True, help="Standard deviation of the noise of the measured position.")
@click.option("--dt", "dt_s", type=float, required=True, metavar="S", help="Sample time.")
@click.option("--span", "span_s", type=float, required=True, metavar="S", help="Time for the experiment.")
@click.option("--json", "json_file", metavar="FILE", help="Write the whole answer as JSON; - is standard output.")
@invoke_guard
def excitation(json_file, **given) -> None:
    """The sinusoid that shows a resonance best in the time there is."""
    plan = sinusoids.excitation(**given)
    curve = [{"ratio": float(r), "omega_0_sd": float(s)} for r, s in zip(plan.ratios, plan.omega_0_sds)]
    write_document(json_file, _document(records=[], notices=[], given=given, omega_rad_s=plan.omega_rad_s, ratio=plan.ratio, omega_0_sd=plan.omega_0_sd, zeta_sd=plan.zeta_sd, curve=curve))
    console = stdout_console(json_file)
    console.print(Text(f"Excite at {plan.omega_rad_s:.4g} rad/s ({plan.ratio:.3g} times the natural frequency).", style="bold"))
    console.print(f"The natural frequency can then be known to {100 * plan.omega_0_sd:.3g} % (standard deviation; no unbiased estimator does better)"
                  + (f", the damping ratio to {100 * plan.zeta_sd:.3g} %." if plan.zeta_sd is not None else "."))
    table = Table("omega / omega_0", "standard deviation of omega_0", box=None, pad_edge=False)
    for r, s in zip(plan.ratios[::3], plan.omega_0_sds[::3]):
        table.add_row(f"{r:.3g}", f"{100 * s:.3g} %")
    console.print(table)


@click.command()
@click.option("--dt", "dt_s", type=float, required=True, metavar="S", help="Sample time.")
@click.option("--bandwidth", "bandwidth_rad_s", type=float, required=True, metavar="RAD_S", help="Fastest motion to identify: the highest resonance or corner.")
@click.option("--noise", type=click.FloatRange(min=0), default=0.0, show_default=True, help="Noise of the measured signal over its root mean square.")
@click.option("--order", type=click.IntRange(1, 6), default=2, show_default=True, help="Order n of the equation.")
@click.option("--zeros", type=click.IntRange(0, 6), default=0, show_default=True, help="Highest derivative of the input.")
@click.option("--no-input", is_flag=True, help="The equation has no input.")
@click.option("--json", "json_file", metavar="FILE", help="Write the whole answer as JSON; - is standard output.")
@invoke_guard
def suggest(json_file, no_input, zeros, **given) -> None:
    """Filters for frequency shifting: poles and shift q from sample time, bandwidth and noise."""
    offered = shifting.suggest(zeros=None if no_input else zeros, **given)
    write_document(json_file, _document(records=[], notices=[], given={**given, "zeros": offered.zeros}, poles_rad_s=list(offered.poles_rad_s), q_per_s=offered.q_per_s, bandwidth_rad_s=offered.poles_rad_s[0]))
    console = stdout_console(json_file)
    console.print(Text(f"{len(offered.poles_rad_s)} poles at {offered.poles_rad_s[0]:.4g} rad/s, q = {offered.q_per_s:.4g} 1/s", style="bold"))
    console.print("for driveid.shifting.identify (the full form). A gateway runs the economical form, which has no q; in its configuration:")
    console.print(f"    bandwidth_rad_s = {offered.poles_rad_s[0]:.4g}     # or: motion_rad_s = {given['bandwidth_rad_s']:.4g}", highlight=False)


COMMANDS = [frequency, excitation, suggest]
