# SPDX-License-Identifier: Apache-2.0
"""The full hidden-effect set: more than 1,000 cases, resumable, two processes, table into docs/hidden-effects.md.

    python tests/hidden/full.py [--commit HASH] [--repeats 8] [--limit N] [--only EFFECT] [--results FILE] [--table FILE] [--shallow]
"""
import argparse
import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import cases  # noqa: E402
import run  # noqa: E402
import table  # noqa: E402


def head():
    return subprocess.run(["git", "rev-parse", "HEAD"], cwd=run.TOP, capture_output=True, text=True, check=True).stdout.strip()


def read_results(file):
    try:
        return [json.loads(line) for line in Path(file).read_text().splitlines() if line.strip()]
    except FileNotFoundError:
        return []


def work(case, deep):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return run.run_case(case, deep=deep)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--quick", action="store_true", help="the quick set instead of the full one")
    p.add_argument("--commit", default=None, help="hash that the seeds come from (default: HEAD)")
    p.add_argument("--repeats", type=int, default=8, help="cases of each effect and size")
    p.add_argument("--limit", type=int, default=0, help="only the first N cases of the shuffled set")
    p.add_argument("--only", action="append", default=[], help="only cases that hide this effect (or: none, outside, pair)")
    p.add_argument("--results", default=None, help="JSON lines, appended to; a case that is there is not run again")
    p.add_argument("--table", default=None, help="markdown to write (default: docs/hidden-effects.md for a whole set)")
    p.add_argument("--shallow", action="store_true", help="do not fit the true model beside each answer")
    p.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    o = p.parse_args()
    commit = o.commit or head()
    results_file = o.results or str(run.TOP / "out" / f"hidden-{commit[:12]}.jsonl")
    Path(results_file).parent.mkdir(parents=True, exist_ok=True)
    wanted = [c for c in (cases.quick_set() if o.quick else cases.full_set(commit, o.repeats)) if not o.only or c.group in o.only or any(e in o.only for e in c.effects)]
    wanted = wanted[: o.limit] if o.limit else wanted
    done = {r["case"]: r for r in read_results(results_file)}
    left = [c for c in wanted if c.name not in done]
    print(f"{len(wanted)} cases, {len(wanted) - len(left)} already in {results_file}", file=sys.stderr)
    pool = ProcessPoolExecutor(o.processes)
    try:
        with open(results_file, "a") as f:
            for n, future in enumerate(as_completed([pool.submit(work, c, not o.shallow) for c in left]), 1):
                r = future.result()
                done[r["case"]] = r
                f.write(json.dumps(r) + "\n")
                f.flush()
                print(f"{n}/{len(left)} {r['case']}: {'right' if r.get('right') else table.wrong_answer(r)} {r.get('seconds')} s", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        pool.shutdown(wait=False, cancel_futures=True)
        print("stopped; run again to go on", file=sys.stderr)
        return 130
    note = f"Seeds from commit `{commit[:12]}`; made by `python tests/hidden/full.py`."
    text = table.markdown([done[c.name] for c in wanted if c.name in done], "Hidden effects", note)
    whole = not o.only and not o.limit and not o.quick
    target = o.table or (str(run.TOP / "docs/hidden-effects.md") if whole else None)
    if target:
        Path(target).write_text(text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
