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
    """Asks for the values of the space and returns them."""
    layers = trial.suggest_int("n_layers", 2, 12)
    values = [layers]
    for ending in [""] if flat else [f"_{i}" for i in range(layers)]:
        values.append(trial.suggest_int("units" + ending, 32, 256))
        values.append(trial.suggest_categorical("activation" + ending, ACTIVATIONS))
        values.append(trial.suggest_float("dropout" + ending, 0.0, 0.5))
    values.append(trial.suggest_categorical("optimizer", ["adam", "sgd"]))
    values.append(trial.suggest_float("learning_rate", 1e-5, 1e-2, log=True))
    if values[-2] == "sgd":
        values.append(trial.suggest_float("momentum", 0.0, 0.9))
    return values


def loss(values):
    """A value that depends on all of them."""
    return sum(math.sin(len(v) if isinstance(v, str) else v) for v in values)


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
    source = library.create_study(sampler=library.samplers.RandomSampler(seed=7))
    study = library.create_study(sampler=library.samplers.TPESampler(seed=1))
    for _ in range(past):
        trial = source.ask()
        value = loss(suggest(trial, flat))
        for step in range(REPORTS if hasattr(trial, "report") else 0):
            trial.report(value + 1.0 / (step + 1), step)
        source.tell(trial.number, value)
    for trial in source.trials:
        study.add_trial(trial)
    asks, tells, both, params = [], [], [], 0
    for _ in range(REPEATS + 1):
        begun = time.perf_counter()
        trial = study.ask()
        values = suggest(trial, flat)
        asked = time.perf_counter()
        params += len(values)
        value = loss(values)
        telling = time.perf_counter()
        study.tell(trial.number, value)
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
