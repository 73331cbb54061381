# SPDX-License-Identifier: Apache-2.0
"""Results of a set as a markdown table, next to the goals."""
from collections import Counter, defaultdict

GOALS = {"first_all": 0.98, "first_strong": 0.99, "none_answered": 0.01, "outside_unknown": 0.93, "pairs": 0.85, "first_1.05": 0.88, "names": 1.3, "unknown_catalogue": 0.03,
         "held_out": 1.1}


def share(rows, key="right"):
    rows = list(rows)
    return sum(bool(r.get(key)) for r in rows) / len(rows) if rows else None


def summary(results):
    """Numbers of a set, by the names of GOALS and some more. A rightly undetected effect (true regressor not significant) counts for nothing."""
    counted = [r for r in results if not r.get("excused")]
    single = [r for r in counted if r["group"] == "single"]
    of = {g: [r for r in counted if r["group"] == g] for g in ("none", "outside", "pair")}
    answered = [r for r in single if r.get("first")]
    covers = [c[1] for r in results for c in r.get("coverage", [])]
    ratios = [r["held_out_over_true"] for r in results if "held_out_over_true" in r]
    seconds = sorted(r["seconds"] for r in results if "seconds" in r)
    none_answered = share(of["none"])
    return {
        "cases": len(results), "failed": sum(r.get("verdict") == "failed" for r in results),
        "excused": len(results) - len(counted),
        "first_all": share(single), "first_strong": share(r for r in single if r["size"] >= 3),
        **{f"first_{size}": share(r for r in single if r["size"] == size) for size in (10, 3, 1.2, 1.05, 1.01)},
        "none_answered": None if none_answered is None else 1 - none_answered,
        "outside_unknown": share(of["outside"]), "pairs": share(of["pair"]),
        "names": sum(r["names"] for r in answered) / len(answered) if answered else None,
        "unknown_catalogue": share({"right": r.get("verdict") == "unknown"} for r in single),
        "held_out_within_1.1": sum(x <= GOALS["held_out"] for x in ratios) / len(ratios) if ratios else None,
        "coverage": sum(covers) / len(covers) if covers else None, "intervals": len(covers),
        "median_s": seconds[len(seconds) // 2] if seconds else None, "longest_s": seconds[-1] if seconds else None,
    }


def percent(x):
    return "-" if x is None else f"{100 * x:.1f} %"


def markdown(results, title, note=""):
    s = summary(results)
    lines = [f"# {title}", "", note, "", f"{s['cases']} cases, {s['failed']} without an answer, {s['excused']} undetectable ones set aside (the true regressor itself is not significant there).", "",
             "| what | reached | goal |", "|---|---|---|",
             f"| right effect (or its real tie) first, all sizes | {percent(s['first_all'])} | 98 % |",
             f"| the same, strong and medium (10, 3) | {percent(s['first_strong'])} | 99 % |"]
    lines += [f"| the same, size {size} | {percent(s[f'first_{size}'])} | {'88 %' if size == 1.05 else '-'} |" for size in (10, 3, 1.2, 1.05, 1.01)]
    lines += [f"| nothing hidden, yet an effect answered | {percent(s['none_answered'])} | at most 1 % |",
              f"| effect outside the catalogue called unknown | {percent(s['outside_unknown'])} | 93 % |",
              f"| both effects of a pair in the first two | {percent(s['pairs'])} | 85 % |",
              f"| catalogue case called unknown | {percent(s['unknown_catalogue'])} | at most 3 % |",
              f"| names per answer | {'-' if s['names'] is None else format(s['names'], '.2f')} | at most 1.3 |",
              f"| held-out error within 1.1 of the true model's | {percent(s['held_out_within_1.1'])} | 100 % |",
              f"| 95 % intervals that cover ({s['intervals']} of them) | {percent(s['coverage'])} | 93 to 97 % |",
              f"| seconds a case, median and longest | {s['median_s']} / {s['longest_s']} | median 6 |", "", "## By effect", "",
              "| effect | " + " | ".join(str(x) for x in (10, 3, 1.2, 1.05, 1.01)) + " | answered instead |", "|---|---|---|---|---|---|---|"]
    by = defaultdict(list)
    for r in results:
        by[(r["group"] != "single", "+".join(r["effects"]) or "none")].append(r)
    for (_, label), rows in sorted(by.items()):
        cells = []
        for size in (10, 3, 1.2, 1.05, 1.01):
            here = [r for r in rows if (r["size"] == size or (label == "none" and size == 10)) and not r.get("excused")]
            cells.append(f"{sum(bool(r.get('right')) for r in here)}/{len(here)}" if here else "")
        wrong = Counter(wrong_answer(r) for r in rows if not r.get("right") and not r.get("excused"))
        lines.append(f"| {label} | " + " | ".join(cells) + " | " + ", ".join(f"{k} {n}" for k, n in wrong.most_common(6)) + " |")
    return "\n".join(lines) + "\n"


def wrong_answer(r):
    if r.get("first"):
        return "+".join(x for x in (r["first"], r.get("second") if r["group"] == "pair" else None) if x)
    return r.get("verdict", "?")
