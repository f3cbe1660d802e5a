"""The ratios of `surgsim bench` against those that are kept in ratios.json; exit status 1 if one has grown.

python benchmarks/ratios.py            compare
python benchmarks/ratios.py --keep     measure and keep
"""

import argparse
import json
import os
from pathlib import Path

from surgsim.runs.bench import bench

KEPT = Path(__file__).with_name("ratios.json")
GROWN = 1.25
"""Grown by so much, a ratio is a regression: two runs of the same code differ by less."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--keep", action="store_true", help="keep what is measured")
    keep = parser.parse_args().keep
    load = os.getloadavg()[0]
    ratios = {row["run"]: round(row["ratio"], 2) for row in bench(3.0, 1)}
    if keep:
        KEPT.write_text(
            json.dumps({"load": round(load, 1), "ratios": ratios}, indent=2) + "\n", encoding="utf-8"
        )
        return 0
    kept = json.loads(KEPT.read_text(encoding="utf-8"))["ratios"]
    grown = {name: ratio for name, ratio in ratios.items() if ratio > GROWN * kept.get(name, ratio)}
    for name, ratio in ratios.items():
        print(f"{name}: {ratio} (kept: {kept.get(name)}){' GROWN' if name in grown else ''}")
    return 1 if grown else 0


if __name__ == "__main__":
    raise SystemExit(main())
