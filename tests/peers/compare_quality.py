"""Compares what `search_quality --raw FILE` found with what Optuna and Rustuna found.

Usage: compare_quality.py FILE [FOLDER]. FOLDER (default: bench/raw in the folder named by PANOTUNE_DATA_DIR) has
files `<version>_<sampler>_<objective>.json` with the best values after 10, 30, 60 and 100 trials for seeds 0 to 99.

For each objective, after 30 and 100 trials: our median, the best reference's, and the largest over the
references of the upper 95 % bound of (our median - theirs), from a bootstrap over seeds, as a share of 5 % of
(random search's median - the minimum). Up to 1 ours is not worse. A star: better than Optuna 4.9's default with 97.5 %.
"""

import json
import os
import random
import statistics
import sys

REFERENCES = ["4.9.0_tpe_default", "4.9.0_tpe_mv_group", "5.0.0_tpe_default", "rustuna-0.2.0_tpe_default"]
CHECKPOINTS = {30: 1, 100: 3}
RESAMPLES = 2000
STUCK = {"nas_conditional": 0.25, "nas_flat7": 0.1, "cond_branch": 0.3}


def differences(ours, theirs, source):
    """Sorted differences of medians of resampled seeds."""
    resampled = lambda values: statistics.median(source.choices(values, k=len(values)))
    return sorted(resampled(ours) - resampled(theirs) for _ in range(RESAMPLES))


def main():
    found = json.load(open(sys.argv[1]))
    folder = sys.argv[2] if len(sys.argv) > 2 else os.path.join(os.environ["PANOTUNE_DATA_DIR"], "bench", "raw")
    read = lambda sampler, objective: json.load(open(os.path.join(folder, f"{sampler}_{objective}.json")))["best"]
    source = random.Random(0)
    holds = better = 0
    for objective, entry in found.items():
        bounds = []
        for trials, k in CHECKPOINTS.items():
            at = lambda table: [row[k] for row in table]
            ours = at(entry["best"])
            slack = 0.05 * (statistics.median(at(read("4.9.0_random", objective))) - entry["minimum"])
            all_differences = [differences(ours, at(read(r, objective)), source) for r in REFERENCES]
            upper = max(d[int(0.95 * RESAMPLES)] for d in all_differences)
            bounds.append(upper / slack if slack > 1e-9 else (0.0 if upper <= 0.0 else float("inf")))
            star = "*" if all_differences[0][int(0.975 * RESAMPLES)] < 0.0 else " "
            better += trials == 100 and star == "*"
            best = min(statistics.median(at(read(r, objective))) for r in REFERENCES)
            median = statistics.median(ours)
            print(f"{objective:16} {trials:4} {median:10.4f} {best:10.4f} {bounds[-1]:+7.2f}{star}")
        holds += max(bounds) <= 1.0
        if objective in STUCK:
            last = [row[3] for row in entry["best"]]
            above = sum(x > STUCK[objective] for x in last)
            print(f"{objective:16}      {above} of {len(last)} seeds above {STUCK[objective]} after 100 trials")
    print(f"not worse than any reference on {holds} of {len(found)} objectives at both; "
          f"better than Optuna 4.9's default after 100 trials on {better}")


if __name__ == "__main__":
    main()
