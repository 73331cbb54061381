# SPDX-License-Identifier: Apache-2.0
"""Which cases the hidden-effect suite runs: a quick set for the test command and a full set by hand.

A case is drawn from a seed by driveid-sim; everything else about it (structure, effect, size) stands here.
"""
import hashlib
import random
from dataclasses import asdict, dataclass, field

MECHANICAL = ["coulomb", "stribeck", "lugre", "asymmetric_friction", "load_dependent_friction", "quadratic_drag", "constant_load",
              "gravity_unbalance", "cogging", "torque_ripple", "eccentric_friction", "backlash", "compliance", "delay", "torque_saturation",
              "current_offset", "encoder_eccentricity", "inertia_change", "friction_drift", "hysteresis", "dead_zone"]
ELECTRICAL = ["resistance_drift", "dead_time_voltage"]
CATALOGUE = MECHANICAL + ELECTRICAL
OUTSIDE = ["cubic_spring", "position_inertia", "eddy_brake", "random_walk_load", "warm_spot_friction", "gear_mesh", "end_stop", "parametric_belt"]
PAIRS = [("coulomb", "cogging"), ("coulomb", "gravity_unbalance"), ("stribeck", "constant_load"), ("cogging", "quadratic_drag"), ("coulomb", "compliance"),
         ("constant_load", "torque_ripple"), ("coulomb", "quadratic_drag"), ("gravity_unbalance", "inertia_change"), ("coulomb", "delay"),
         ("cogging", "inertia_change"), ("coulomb", "torque_ripple"), ("asymmetric_friction", "cogging")]
SIZES = [10, 3, 1.2, 1.05, 1.01]

STRUCTURES = {name: ["rigid_axis", "rigid_axis", "rigid_axis", "linear_axis", "dc_drive", "pmsm_drive"] for name in CATALOGUE + OUTSIDE}
ROTARY = ["rigid_axis", "rigid_axis", "dc_drive", "pmsm_drive"]
for _name in ("gravity_unbalance", "eccentric_friction", "encoder_eccentricity", "current_offset", "position_inertia", "warm_spot_friction", "gear_mesh", "parametric_belt"):
    STRUCTURES[_name] = ROTARY
for _name in ("delay", "dead_zone"):
    STRUCTURES[_name] = ["rigid_axis", "rigid_axis", "linear_axis"]
for _name in ELECTRICAL:
    STRUCTURES[_name] = ["dc_circuit", "dc_circuit", "dc_drive", "pmsm_drive"]


@dataclass(frozen=True)
class Case:
    name: str
    seed: int
    structure: str
    effects: tuple = ()      # empty: nothing is hidden
    size: float = 3
    group: str = "single"    # single | none | outside | pair
    dirt: str = "auto"
    train_s: float = 20
    held_out_s: float = 12
    rate_Hz: int = 0         # 0: drawn
    options: tuple = field(default=("--draw-known-coulomb",))

    def arguments(self):
        out = ["--seed", str(self.seed), "--structure", self.structure, "--size", str(self.size), "--dirt", self.dirt,
               "--train-s", str(self.train_s), "--held-out-s", str(self.held_out_s), *self.options]
        for effect in self.effects or ("none",):
            out += ["--effect", effect]
        return out + (["--rate", str(self.rate_Hz)] if self.rate_Hz else [])

    def as_dict(self):
        return asdict(self)


def seed_of(root, *parts):
    """A seed that nobody chose: from the root (a commit's hash) and the case's place in the set."""
    text = " ".join(map(str, (root, *parts)))
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:6], "big")


def _case(root, group, effects, size, number, **more):
    label = "+".join(effects) or "none"
    seed = seed_of(root, group, label, size, number)
    structures = [s for s in STRUCTURES.get(effects[0], STRUCTURES["coulomb"]) if all(s in STRUCTURES[e] for e in effects)] if effects else STRUCTURES["coulomb"] + ["dc_circuit"]
    structure = random.Random(seed).choice(structures)
    return Case(f"{group}-{label}-{size}-{number}", seed, structure, tuple(effects), size, group, **more)


def full_set(root, repeats=8):
    """At least 1,000 cases; repeats cases of each effect and size."""
    out = [_case(root, "single", [e], size, n) for n in range(repeats) for size in SIZES for e in CATALOGUE]
    out += [_case(root, "none", [], 1, n) for n in range(max(1, 10 * repeats))]
    out += [_case(root, "outside", [e], size, n) for n in range(max(1, repeats // 2)) for size in (10, 3, 1.2) for e in OUTSIDE]
    out += [_case(root, "pair", list(p), size, n) for n in range(max(1, repeats // 3)) for size in (10, 3) for p in PAIRS]
    random.Random(seed_of(root, "order")).shuffle(out)  # a part of the set is a fair sample of it
    return out


def quick_set(root="quick"):
    """At least 60 cases that fit into six minutes: short records at 500 and 1000 Hz."""
    short = dict(train_s=14, held_out_s=10, rate_Hz=500)
    out = [_case(root, "single", [e], 3, 0, **short) for e in CATALOGUE]
    out += [_case(root, "single", [e], 10, 1, **short) for e in ("coulomb", "stribeck", "cogging", "compliance", "delay", "constant_load", "hysteresis", "dead_time_voltage")]
    out += [_case(root, "single", [e], 1.2, 2, **short) for e in ("coulomb", "gravity_unbalance", "cogging", "quadratic_drag", "inertia_change", "dead_zone")]
    out += [_case(root, "single", [e], 1.05, 3, **short) for e in ("coulomb", "gravity_unbalance", "constant_load")]
    out += [_case(root, "none", [], 1, n, **short) for n in range(9)]
    out += [_case(root, "outside", [e], 10, 0, **short) for e in OUTSIDE]
    out += [_case(root, "pair", list(p), 10, 0, **short) for p in PAIRS[:6]]
    return out
