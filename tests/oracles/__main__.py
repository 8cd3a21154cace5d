"""`python -m oracles`: compare many points with the oracle, print the differences, and write their list."""

from __future__ import annotations

import argparse
import json
import sys
import time

from oracles.comparison import compare
from oracles.families import FAMILIES, random_point
from oracles.known import SEEDS, known_seeds

N_POINTS = 5000
SHOWN = 3


def main() -> int:
    """Compare, print what is new and what is mended; return 1 if anything is new."""
    parser = argparse.ArgumentParser(prog="python -m oracles", description=__doc__)
    parser.add_argument("--family", choices=FAMILIES, action="append", help="a family; all by default")
    parser.add_argument("--n", type=int, default=N_POINTS, help="points of each family")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first")
    parser.add_argument("--show", type=int, default=SHOWN, help="how many new ones of a kind are printed")
    parser.add_argument("--record", action="store_true", help="write the list of known differences")
    arguments = parser.parse_args()
    seeds = range(arguments.seed, arguments.seed + arguments.n)
    listed = json.loads(SEEDS.read_text(encoding="utf-8")) if SEEDS.exists() else {}
    n_new = 0
    for family in arguments.family or FAMILIES:
        known = known_seeds(family, seeds) if SEEDS.exists() else {}
        found: dict[str, list[int]] = {}
        new: dict[str, list[str]] = {}
        n_sure = n_mended = 0
        start = time.monotonic()
        for seed in seeds:
            point = random_point(family, seed)
            compared = compare(point)
            n_sure += compared.is_sure
            n_mended += len(known.get(seed, set()) - compared.differences.keys())
            for kind, text in compared.differences.items():
                found.setdefault(kind, []).append(seed)
                if kind not in known.get(seed, set()):
                    new.setdefault(kind, []).append(f"seed {seed}: {text}\n{point.source}")
        n_new += sum(map(len, new.values()))
        kinds = ", ".join(f"{kind} {len(which)}" for kind, which in sorted(found.items())) or "none"
        seconds = time.monotonic() - start
        print(f"{family}: {len(seeds)} points, {n_sure} sure in every mode, {seconds:.0f} s")
        print(f"  differences: {kinds}")
        print(f"  new {sum(map(len, new.values()))}, mended {n_mended}", flush=True)
        for kind, texts in new.items():
            print(*(f"  {kind}, {text}" for text in sorted(texts, key=len)[: arguments.show]), sep="\n")
        # What is known of other points stays.
        kept = {kind: [s for s in which if s not in seeds] for kind, which in listed.get(family, {}).items()}
        merged = {kind: sorted({*kept.get(kind, []), *found.get(kind, [])}) for kind in {*kept, *found}}
        listed[family] = {kind: which for kind, which in sorted(merged.items()) if which}
    if arguments.record:
        SEEDS.write_text(_text(listed), encoding="utf-8")
    return 1 if n_new else 0


def _text(listed: dict[str, dict[str, list[int]]]) -> str:
    """Return the list as JSON with a line for every kind."""
    families = []
    for family, kinds in listed.items():
        lines = ",\n".join(f"    {json.dumps(kind)}: {json.dumps(which)}" for kind, which in kinds.items())
        families.append(
            f"  {json.dumps(family)}: {{\n{lines}\n  }}" if lines else f"  {json.dumps(family)}: {{}}"
        )
    return "{\n" + ",\n".join(families) + "\n}\n"


if __name__ == "__main__":
    sys.exit(main())
