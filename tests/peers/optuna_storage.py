"""What Optuna and its dashboard make of storages: each command prints one JSON document.

begin FILE               a study `theirs` in a new storage: mixed parameters, every state, a queue
dump FILE STUDY          the study as Optuna loads it, in the form of the golden files
continue FILE STUDY N    N more trials by TPE, with the parameters of the first trial; prints their numbers
analyse FILE STUDY       importances and plots
dashboard FILE STUDY     the dashboard's own server on loopback: statuses and trials of its answers

FILE is a database if it ends in `.sqlite3` or `.db`, a journal otherwise.
"""

import contextlib
import json
import math
import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import optuna
from optuna.distributions import CategoricalDistribution, distribution_to_json
from optuna.storages import JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import TrialState

optuna.logging.set_verbosity(optuna.logging.ERROR)


def is_database(path):
    return path.endswith((".sqlite3", ".db"))


def open_storage(path):
    return RDBStorage(f"sqlite:///{path}") if is_database(path) else JournalStorage(JournalFileBackend(path))


def plain(value):
    """Doubles that JSON lacks as words."""
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else ("inf" if value > 0 else "-inf")
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return value


def begin(path):
    study = optuna.create_study(
        study_name="theirs", storage=open_storage(path), direction="maximize",
        sampler=optuna.samplers.TPESampler(seed=3, n_startup_trials=2),
    )
    study.set_user_attr("ü", [1, None, "日本"])
    study.enqueue_trial({"x": 0.5, "kind": None}, user_attrs={"why": "expert"})

    def objective(trial):
        x = trial.suggest_float("x", 0.0, 1.0)
        kind = trial.suggest_categorical("kind", ["relu", None, True, 2.5, 7])
        if kind == "relu":
            trial.suggest_int("n", 1, 64, log=True)
        q = trial.suggest_float("q", 0.0, 1.0, step=0.1)
        for step, report in enumerate([x, float("nan"), float("inf")]):
            trial.report(report, step)
        trial.set_user_attr("note", "a\n\"b\"")
        if trial.number == 3:
            raise optuna.TrialPruned
        if trial.number == 4:
            raise ValueError
        return float("inf") if trial.number == 5 else x + q

    study.optimize(objective, n_trials=8, catch=(ValueError,))
    study.enqueue_trial({"x": 0.25})
    study.ask(), study.enqueue_trial({"x": 0.75})
    return len(study.trials)


def load(path, name, **options):
    return optuna.load_study(study_name=name, storage=open_storage(path), **options)


def stamp(moment):
    return None if moment is None else moment.isoformat(timespec="microseconds")


def dump(path, name):
    study = load(path, name)
    return {
        "study_name": study.study_name,
        "directions": [d.name for d in study.directions],
        "user_attrs": study.user_attrs,
        "system_attrs": study._storage.get_study_system_attrs(study._study_id),
        "trials": [
            {
                "number": t.number,
                "state": t.state.name,
                "values": t.values,
                "params": t.params,
                "distributions": {k: json.loads(distribution_to_json(d)) for k, d in t.distributions.items()},
                "user_attrs": t.user_attrs,
                "system_attrs": t.system_attrs,
                "intermediate_values": sorted(t.intermediate_values.items()),
                "datetime_start": stamp(t.datetime_start),
                "datetime_complete": stamp(t.datetime_complete),
            }
            for t in study.get_trials(deepcopy=False)
        ],
    }


def go_on(path, name, count):
    study = load(path, name, sampler=optuna.samplers.TPESampler(seed=1, n_startup_trials=1))
    space = next(t.distributions for t in study.trials if t.state == TrialState.COMPLETE)
    numbers = []

    def objective(trial):
        numbers.append(trial.number)
        total = 0.0
        for key, d in space.items():
            value = trial._suggest(key, d)
            total += d.to_internal_repr(value) if isinstance(d, CategoricalDistribution) else float(value)
        trial.report(total, 0)
        return total if len(study.directions) == 1 else tuple(total for _ in study.directions)

    study.optimize(objective, n_trials=int(count))
    return numbers


def analyse(path, name):
    study = load(path, name)
    evaluator = optuna.importance.PedAnovaImportanceEvaluator()
    plots = optuna.visualization
    figures = {
        "history": plots.plot_optimization_history(study),
        "curves": plots.plot_intermediate_values(study),
        "parallel": plots.plot_parallel_coordinate(study),
        "slice": plots.plot_slice(study),
        "timeline": plots.plot_timeline(study),
    }
    return {
        "best": study.best_trial.number,
        "summaries": [s.n_trials for s in optuna.get_all_study_summaries(study._storage)],
        "importances": optuna.importance.get_param_importances(study, evaluator=evaluator),
        "traces": {k: len(f.data) for k, f in figures.items()},
    }


def get(base, path):
    with urllib.request.urlopen(base + path, timeout=10) as answer:
        return answer.status, answer.read()


@contextlib.contextmanager
def served(path):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    program = os.path.join(os.path.dirname(sys.executable), "optuna-dashboard")
    place = f"sqlite:///{path}" if is_database(path) else path
    server = subprocess.Popen(
        [program, place, "--host", "127.0.0.1", "--port", str(port)],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )
    try:
        base = f"http://127.0.0.1:{port}"
        for _ in range(300):
            with contextlib.suppress(OSError):
                get(base, "/api/meta")
                break
            time.sleep(0.1)
        yield base
    finally:
        server.terminate()
        server.wait()


def dashboard(path, name):
    with served(path) as base:
        status, body = get(base, "/api/studies")
        studies = json.loads(body)["study_summaries"]
        number = next(s["study_id"] for s in studies if s["study_name"] == name)
        detail, body = get(base, f"/api/studies/{number}?after=0")
        study = json.loads(body)
        page, _ = get(base, f"/dashboard/studies/{number}")
        importances, _ = get(base, f"/api/studies/{number}/param_importances")
        return {
            "statuses": [status, detail, page, importances],
            "names": [s["study_name"] for s in studies],
            "trials": [
                {"number": t["number"], "state": t["state"].upper(), "params": sorted(p["name"] for p in t["params"])}
                for t in study["trials"]
            ],
        }


COMMANDS = {"begin": begin, "dump": dump, "continue": go_on, "analyse": analyse, "dashboard": dashboard}

if __name__ == "__main__":
    print(json.dumps(plain(COMMANDS[sys.argv[1]](*sys.argv[2:]))))
