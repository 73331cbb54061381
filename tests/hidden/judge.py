# SPDX-License-Identifier: Apache-2.0
"""Score one answer of `driveid explain` against the truth: pure functions over two JSON documents.

Truth comes from the simulator, the answer from the command line; the score needs no code of the product.
"""
import math

SIGNIFICANT_T = 2.0    # a true regressor below this in a record cannot be called detectable in it
TIE_TOLERANCE = 0.05   # members of a tie fit held-out data this well, next to the true model


def names_of(answer):
    """Accepted effects in order, each with the members of its tie."""
    return [[entry["effect"], *entry.get("not_told_apart_from", [])] for entry in answer.get("ranked", []) if entry.get("accepted")]


def undetectable(truth):
    return min(truth["train"]["significance"], truth["held_out"]["significance"]) < SIGNIFICANT_T


def judge(case, truth, answer, tie_is_real):
    """Result of a case as a dict of plain values. tie_is_real(names) -> bool fits the members on held-out data; asked only where it decides."""
    accepted = names_of(answer)
    verdict = answer.get("verdict", "none")
    first = accepted[0] if accepted else []
    out = {"verdict": verdict, "first": first[0] if first else None, "ties": first[1:], "second": accepted[1][0] if len(accepted) > 1 else None,
           "names": len(first), "detectable": not undetectable(truth)}
    hidden = list(case["effects"])
    if case["group"] == "none":
        out["right"] = not accepted and verdict not in ("missing", "cannot_tell")
    elif case["group"] == "outside":
        out["right"] = verdict == "unknown"
    elif case["group"] == "pair":
        named = {n for group in accepted[:2] for n in group}
        out["right"] = all(h in named for h in hidden)
    else:
        out["right"], out["tie"] = False, False
        if first and first[0] == hidden[0]:
            out["right"] = True
        elif hidden[0] in first:
            real = tie_is_real(first)
            out["right"], out["tie"], out["tie_real"] = real, True, real
        elif not accepted and verdict == "nothing_missing" and not out["detectable"]:
            out["excused"] = True
    return out


# Published symbols of the linear frame, to those of the rotary one in which the truth is written.
LINEAR = {"F_c": "tau_c", "F_s": "tau_s", "v_s": "omega_s", "F_0": "tau_0", "F_c_pos": "tau_c_pos", "F_c_neg": "tau_c_neg", "F_h": "tau_h", "x_h": "theta_h",
          "dF_c": "dtau_c", "dm": "dJ", "m_l": "J_l", "db": "dB"}
SUFFIXES = ["Nms2_rad2", "As2_rad2", "Ns2_m2", "As2_m2", "Vs2_rad2", "Nms_rad", "As2_rad", "As2_m", "Ns_m", "As_rad", "As_m", "kgm2", "Nm_rad", "A_rad", "N_m", "A_m", "rad_s",
            "m_s", "rad_m", "kg", "Nm", "ohm", "rad", "A", "N", "V", "s", "m"]
PHASES = {"phi", "theta_0"}
WARMING_K = 30.0       # how far the simulated machine warms up while its friction drifts


def symbol_of(name):
    for suffix in SUFFIXES:
        if name.endswith("_" + suffix):
            name = name[: -len(suffix) - 1]
            break
    return LINEAR.get(name, name)


def torque_factor(case, truth, given):
    """What a true torque reads like to somebody who was given this K_t, or none (then: ampere)."""
    drive = truth["drive"]
    true_K = drive.get("K_t_Nm_A", drive.get("K_F_N_A"))
    known = given.get("K_t_Nm_A", given.get("K_F_N_A"))
    if known is not None:
        return known / true_K
    return 1.0 if truth.get("measures_torque") or case["structure"] == "pmsm_drive" else 1.0 / true_K


def coverage(case, truth, answer, given):
    """[(symbol, covered, distance of the truth in half-widths)] of the right answer's parameters whose truth the simulator states in the same words."""
    out = []
    entry = next((e for e in answer.get("ranked", []) if e.get("accepted") and e["effect"] in case["effects"]), None)
    if entry is None:
        return out
    hidden = next(e for e in truth["effects"] if e["effect"] == entry["effect"])
    true = {p["name"]: p for p in hidden["parameters"]}
    factor = torque_factor(case, truth, given)
    order = entry.get("parameters", {}).get("N")
    if order and "N" in true and abs(order["value"] - true["N"]["value"]) > 0.01 * abs(true["N"]["value"]):
        return out  # another harmonic of the same effect: its truth is not stated
    for name, stated in entry.get("parameters", {}).items():
        symbol = symbol_of(name)
        interval = stated.get("interval")
        if symbol not in true or not interval or interval[0] is None or interval[0] == interval[1]:
            continue
        # a dead zone is stated in the unit of the input: A where a current is read
        unit_factor = factor / (given.get("K_t_Nm_A") or given.get("K_F_N_A") or 1.0) if symbol == "u_d" and name.endswith("_A") and given else factor
        value = true[symbol]["value"] * (unit_factor if true[symbol]["torque"] else 1.0)
        lo, hi = interval
        if entry["effect"] == "friction_drift" and truth.get("has_temperature") and symbol in ("dtau_c", "dB"):
            value /= WARMING_K / 10  # stated for 10 K where a temperature is read
        if symbol == "T_d":  # the reading's own instant lies anywhere within half a sample
            skew = 0.5 / truth["rate_Hz"]
            value = min(max(0.5 * (lo + hi), value - skew), value + skew)
        if symbol in PHASES:
            middle = 0.5 * (lo + hi)
            value = middle + math.remainder(value - middle, 2 * math.pi)
        out.append((symbol, bool(lo <= value <= hi), round((value - 0.5 * (lo + hi)) / (0.5 * (hi - lo)), 2)))
    return out
