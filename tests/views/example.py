# SPDX-License-Identifier: Apache-2.0
"""A drive of the tests' own: rigid axis with Coulomb friction, simulated here, and the documents that describe it.

The documents are written by hand after CONTRACT "JSON"; the figures in them come from the small fit below, so that pictures and numbers agree."""

from __future__ import annotations

import numpy as np

J, B, TAU_C, K_T, DT = 1.2e-4, 3.0e-5, 0.012, 0.05, 1e-3


def drive(seed: int = 1, rows: int = 10_000) -> dict[str, np.ndarray]:
    """Angle and current of an axis that follows a changing current; friction by small steps."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) * DT
    current = 0.55 * np.sin(2 * np.pi * 0.4 * t) + 0.35 * np.sin(2 * np.pi * 1.3 * t + 1) + 0.15 * np.sign(np.sin(2 * np.pi * 0.17 * t))
    theta, omega = np.zeros(rows), np.zeros(rows)
    for k in range(1, rows):
        w, a = omega[k - 1], theta[k - 1]
        for _ in range(10):
            drive_torque = K_T * current[k - 1] - B * w
            friction = np.clip(drive_torque + J * w / (DT / 10), -TAU_C, TAU_C)  # implicit: holds at rest
            w += DT / 10 * (drive_torque - friction) / J
            a += DT / 10 * w
        omega[k], theta[k] = w, a
    return {"t_s": t, "i_q_A": current + 0.004 * rng.standard_normal(rows), "theta_rad": np.round(theta * 8192 / (2 * np.pi)) / 8192 * 2 * np.pi,
            "omega_rad_s": omega + 0.05 * rng.standard_normal(rows)}


def balance(data: dict[str, np.ndarray], with_coulomb: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least squares of the torque balance with a smoothed slope: torque, prediction, coefficients."""
    kernel = np.hanning(21) / np.hanning(21).sum()
    omega = np.convolve(np.pad(data["omega_rad_s"], 10, "edge"), kernel, "valid")
    torque = K_T * np.convolve(np.pad(data["i_q_A"], 10, "edge"), kernel, "valid")
    columns = [np.gradient(omega, DT), omega] + ([np.tanh(omega / 0.5)] if with_coulomb else [])
    matrix = np.stack(columns, axis=1)
    theta = np.linalg.lstsq(matrix, torque, rcond=None)[0]
    return torque, matrix @ theta, theta


def series(data: dict[str, np.ndarray], with_coulomb: bool) -> tuple[dict, np.ndarray]:
    """Header and values as driveid_series gives them."""
    torque, predicted, _ = balance(data, with_coulomb)
    rows = [("i_q_A", "A", "signal", data["i_q_A"]), ("theta_rad", "rad", "signal", data["theta_rad"]), ("omega_rad_s", "rad/s", "signal", data["omega_rad_s"]),
            ("tau_Nm", "N m", "signal", torque), ("tau_Nm.one_step", "N m", "prediction", predicted), ("torque.equation", "N m", "residual", torque - predicted)]
    header = {"series": [{"name": n, "unit": u, "what": w} for n, u, w, _ in rows], "rows": len(data["t_s"])}
    return header, np.stack([r for *_, r in rows])


def _set(rmse: float, floor: tuple[float, float]) -> dict:
    error = {"rmse": rmse, "unit": "N m", "signal": "tau_Nm", "noise_floor": list(floor), "fit_percent": 100 * (1 - rmse / 0.02)}
    run = {"rmse": rmse * 900, "unit": "rad/s", "signal": "omega_rad_s", "noise_floor": [0.05, 0.06], "fit_percent": 100 * (1 - rmse / 0.03)}
    return {"equation": error, "free_run": run}


def _common(effects: list[dict]) -> dict:
    return {"format": 1, "driveid": "0.1.0",
            "model": {"structure": "rigid_axis", "parameters": {
                "K_t_Nm_A": {"value": K_T, "unit": "N m/A", "state": "given"},
                "J_kgm2": {"value": 1.203e-4, "interval": [1.197e-4, 1.209e-4], "unit": "kg m^2"},
                "B_Nms_rad": {"value": 2.9e-5, "interval": [2.4e-5, 3.4e-5], "unit": "N m s/rad"}}, "effects": effects},
            "records": [{"name": "train.csv", "rows": 10000, "span_s": 9.999, "hash": "9f" * 32, "role": "training"},
                        {"name": "held_out.csv", "rows": 10000, "span_s": 9.999, "hash": "3c" * 32, "role": "held_out"}],
            "notices": ["theta_rad has steps of 767 µrad: an encoder of 8192 counts."]}


MODEL = """format = 1
structure = "rigid_axis"
parameters.J_kgm2 = { value = 1.203e-4, interval = [1.197e-4, 1.209e-4], unit = "kg m^2", state = "free" }
[[effect]]
name = "coulomb"
parameters.tau_c_Nm = { value = 0.01203, interval = [0.0119, 0.01216], unit = "N m", state = "free" }
"""

COULOMB = {"tau_c_Nm": {"value": 0.01203, "interval": [0.0119, 0.01216], "unit": "N m"}}


def explain(verdict: str = "missing") -> dict:
    doc = _common([])
    ranked = [
        {"effect": "coulomb", "accepted": True, "share": 0.984, "confidence": 0.99, "parameters": COULOMB,
         "not_told_apart_from": ["stribeck"] if verdict == "cannot_tell" else []},
        {"effect": "quadratic_drag", "accepted": False, "share": 0.21, "confidence": 0.02, "parameters": {}, "not_told_apart_from": []},
        {"effect": "constant_load", "accepted": False, "share": 0.001, "confidence": 0.01, "parameters": {}, "not_told_apart_from": []}]
    if verdict in ("nothing_missing", "unknown", "bad_data"):
        ranked = [dict(c, accepted=False) for c in ranked] if verdict == "unknown" else []
    x = np.linspace(0.1, 6.2, 40)
    doc |= {"verdict": verdict, "ranked": ranked,
            "where": [{"equation": "tau_Nm", "axis": "speed", "regime": "speed from 0 to 5 rad/s", "range": [0.0, 5.0], "share": 0.33, "rows": 0.08, "statistic": 9.0, "bound": 3.0, "significant": True},
                      {"equation": "tau_Nm", "axis": "direction", "regime": "forward", "share": 0.41, "rows": 0.5, "statistic": 9.0, "bound": 3.0, "significant": True},
                      {"equation": "tau_Nm", "axis": "acceleration", "regime": "acceleration from 300 to 400 rad/s^2", "share": 0.44, "rows": 0.11, "statistic": 1.0, "bound": 3.0, "significant": False}],
            "error_before": {"training": _set(0.0113, (2.6e-4, 3.1e-4)), "held_out": _set(0.0117, (2.6e-4, 3.1e-4))},
            "error_after": {"training": _set(3.0e-4, (2.6e-4, 3.1e-4)), "held_out": _set(3.1e-4, (2.6e-4, 3.1e-4))},
            "next_record": {"motion": "Move slowly through zero speed, both ways, for 20 s.", "why": "Stribeck and Coulomb differ only below 3 rad/s.",
                            "separates": ["coulomb", "stribeck"], "set_points": [{"t_s": 0.0, "omega_rad_s": -3.0}, {"t_s": 10.0, "omega_rad_s": 3.0}]},
            "shape": {"coordinates": ["theta_rad"], "table": [[float(a), float(0.002 * np.sin(3 * a) ** 3)] for a in x], "unit": "N m"} if verdict == "unknown" else None}
    return doc


def compare() -> dict:
    doc = _common([])
    tests = [{"name": "whiteness", "statistic": 41.2, "bound": 3.3, "passed": False}, {"name": "sign(omega)", "statistic": 88.1, "bound": 3.3, "passed": False},
             {"name": "temperature", "statistic": 1.1, "bound": 3.3, "passed": True}]
    for record in doc["records"]:
        record |= _set(0.0113, (2.6e-4, 3.1e-4)) | {"tests": tests, "where": explain()["where"]}
    return doc | {"free_run_rmse": 10.4}


def improve() -> dict:
    doc = _common([{"name": "coulomb", "parameters": COULOMB}])
    first = explain()
    after = {"training": _set(3.0e-4, (2.6e-4, 3.1e-4)), "held_out": _set(3.1e-4, (2.6e-4, 3.1e-4))}
    before = {"effect": None, "parameters": {}, "share_left": 1.0, **first["error_before"]}
    return doc | {"ends": "noise_floor", "model_toml": MODEL,
                  "steps": [before, {"effect": "coulomb", "parameters": COULOMB, "share_left": 0.01, **after}]}
