"""Time of a proposal and of a report in Optuna and Rustuna, in memory, by the number of past trials.

Prints one JSON list of rows as `cargo bench --bench search` has them, of whichever of the two can be imported.
The space is the paper's conditional one or its flat form; past trials are random complete ones with ten
reports each; the first call, which fills caches, is left out.
"""

import json
import math
import statistics
import sys
import time

PAST = [10, 100, 1000, 5000]
REPEATS = 30
REPORTS = 10
ACTIVATIONS = ["relu", "sigmoid", "tanh"]


def suggest(trial, flat):
    """Asks for the values of the space; returns their number."""
    count = 3
    layers = trial.suggest_int("n_layers", 2, 12)
    for ending in [""] if flat else [f"_{i}" for i in range(layers)]:
        trial.suggest_int("units" + ending, 32, 256)
        trial.suggest_categorical("activation" + ending, ACTIVATIONS)
        trial.suggest_float("dropout" + ending, 0.0, 0.5)
        count += 3
    optimizer = trial.suggest_categorical("optimizer", ["adam", "sgd"])
    trial.suggest_float("learning_rate", 1e-5, 1e-2, log=True)
    if optimizer == "sgd":
        trial.suggest_float("momentum", 0.0, 0.9)
        count += 1
    return count


def loss(trial):
    """A value that depends on all parameters."""
    return sum(math.sin(len(name) + (value if isinstance(value, (int, float)) else len(value)))
               for name, value in trial.params.items())


def summary(seconds):
    ms = sorted(1e3 * s for s in seconds[1:])
    return {
        "n": len(ms),
        "mean_ms": statistics.fmean(ms),
        "p50_ms": statistics.median(ms),
        "p90_ms": ms[min(len(ms) * 9 // 10, len(ms) - 1)],
        "max_ms": ms[-1],
    }


def row(library, version, space, past):
    flat = space == "flat"
    study = library.create_study(sampler=library.samplers.RandomSampler(seed=7))
    for _ in range(past):
        trial = study.ask()
        suggest(trial, flat)
        value = loss(trial)
        for step in range(REPORTS):
            trial.report(value + 1.0 / (step + 1), step)
        study.tell(trial, value)
    study.sampler = library.samplers.TPESampler(seed=1)
    asks, tells, both, params = [], [], [], 0
    for _ in range(REPEATS + 1):
        begun = time.perf_counter()
        trial = study.ask()
        params += suggest(trial, flat)
        asked = time.perf_counter()
        value = loss(trial)
        telling = time.perf_counter()
        study.tell(trial, value)
        told = time.perf_counter()
        asks.append(asked - begun)
        tells.append(told - telling)
        both.append(asks[-1] + tells[-1])
    return {
        "version": version,
        "storage": "memory",
        "space": space,
        "sampler": "tpe_default",
        "past_trials": past,
        "params_per_trial_mean": params / (REPEATS + 1),
        "ask_suggest": summary(asks),
        "tell": summary(tells),
        "ask_tell": summary(both),
    }


def main():
    rows = []
    for name in ["optuna", "rustuna"]:
        try:
            library = __import__(name)
            __import__(name + ".samplers")
        except ImportError:
            continue
        if name == "optuna":
            library.logging.set_verbosity(library.logging.ERROR)
        version = getattr(library, "__version__", None)
        if version is None:
            import importlib.metadata
            version = name + "-" + importlib.metadata.version(name)
        for space in ["cond", "flat"]:
            for past in PAST:
                try:
                    rows.append(row(library, version, space, past))
                except Exception as error:  # a library whose interface has changed is left out, and said so
                    print(f"{name} {space} {past}: {error!r}", file=sys.stderr)
    json.dump(rows, sys.stdout)


if __name__ == "__main__":
    main()
