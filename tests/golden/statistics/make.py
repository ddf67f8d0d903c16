"""Makes golden.json: statistics by SciPy, statsmodels and NumPy that src/statistics is held to.

python3 -m venv v && v/bin/pip install scipy==1.17.1 statsmodels==0.15.0 numpy==2.4.6 && v/bin/python make.py
"""

import itertools
import json

import numpy as np
from scipy import stats
from statsmodels.stats.multitest import multipletests

random = np.random.default_rng(7)
golden = {}

# Percentile interval of a mean over clusters, with given clusters drawn in each resample.
values = random.normal(3, 2, 30).round(4)
clusters = np.repeat(np.arange(6), [3, 7, 4, 6, 5, 5])
draws = random.integers(0, 6, (200, 6))
means = [np.concatenate([values[clusters == c] for c in draw]).mean() for draw in draws]
golden["bootstrap"] = {
    "values": values.tolist(),
    "clusters": clusters.tolist(),
    "draws": draws.tolist(),
    "intervals": {str(c): np.quantile(means, [(1 - c) / 2, (1 + c) / 2]).tolist() for c in (0.8, 0.95)},
}

# Paired permutation test: errors of two models on the same views, exchanged a panorama at a time.
sizes = [3, 2, 4, 3, 3, 2, 4]
of = np.repeat(np.arange(len(sizes)), sizes)
hard = random.normal(0, 3, len(sizes))[of]
a = (hard + random.normal(0, 1.0, len(of))).round(4)
b = (1.35 * hard + random.normal(0.4, 1.0, len(of))).round(4)
panoramas = [(a[of == p], b[of == p]) for p in range(len(sizes))]
METRICS = {
    "mae": lambda e: np.abs(e).mean(),
    "mse": lambda e: (e**2).mean(),
    "sde": lambda e: e.std(),
}


def paired(metric):
    def statistic(x, y):
        # 2 p + s stands for the errors of side s in panorama p
        errors = lambda ids: np.concatenate([panoramas[i // 2][i % 2] for i in ids.astype(int)])
        return metric(errors(y)) - metric(errors(x))

    ids = 2 * np.arange(len(sizes))
    return stats.permutation_test(
        (ids, ids + 1), statistic, permutation_type="samples", vectorized=False, n_resamples=np.inf
    )


golden["paired"] = {"clusters": of.tolist(), "a": a.tolist(), "b": b.tolist()}
for name, metric in METRICS.items():
    result = paired(metric)
    golden["paired"][name] = {"difference": result.statistic, "p": result.pvalue}

# Permutation test of two samples whose clusters are exchanged between them.
x = [random.normal(2.0, 1, n).round(4) for n in (3, 2, 4, 3)]
y = [random.normal(3.1, 1, n).round(4) for n in (2, 3, 3, 2, 4)]
pool = x + y


def apart(ids_x, ids_y):
    errors = lambda ids: np.abs(np.concatenate([pool[i] for i in ids.astype(int)])).mean()
    return abs(errors(ids_y) - errors(ids_x))


result = stats.permutation_test(
    (np.arange(4), np.arange(4, 9)), apart, permutation_type="independent", vectorized=False,
    n_resamples=np.inf, alternative="greater",
)
golden["independent"] = {"x": [v.tolist() for v in x], "y": [v.tolist() for v in y], "p": result.pvalue}

# Holm's correction.
p = [0.01, 0.04, 0.03, 0.005, 0.2, 0.03, 1.0]
golden["holm"] = {"p": p, "adjusted": multipletests(p, method="holm")[1].tolist()}

# Student's t.
golden["student"] = [
    {"df": df, "q": q, "t": stats.t.ppf(q, df)}
    for df, q in itertools.product([1, 2, 3.7, 4, 9, 30, 250.5], [0.6, 0.9, 0.975, 0.9995])
]
seeds_a, seeds_b = random.normal(10, 2, 5).round(4), random.normal(12, 3, 4).round(4)
one = stats.ttest_1samp(seeds_a, 0).confidence_interval(0.95)
two = stats.ttest_ind(seeds_b, seeds_a, equal_var=False).confidence_interval(0.95)
golden["intervals"] = {
    "a": seeds_a.tolist(), "b": seeds_b.tolist(), "mean_of_a": list(map(float, one)), "b_minus_a": list(map(float, two)),
}


# Components of variance of a one-way layout with random effects (Searle, Casella and McCulloch 1992, section 3.6).
def components(groups):
    sizes = np.array([len(g) for g in groups])
    total, k = sizes.sum(), len(groups)
    grand = np.concatenate(groups).mean()
    between = sum(n * (np.mean(g) - grand) ** 2 for n, g in zip(sizes, groups)) / (k - 1)
    within = sum(((g - np.mean(g)) ** 2).sum() for g in groups) / (total - k)
    assert np.isclose(between / within, stats.f_oneway(*groups).statistic)
    size = (total - (sizes**2).sum() / total) / (k - 1)
    return {
        "groups": [np.asarray(g).tolist() for g in groups], "size": size, "mean_squares": [between, within],
        "between": max(0.0, (between - within) / size), "within": within,
    }


def layout(sizes, effect):
    return [(effect * random.normal() + random.normal(0, 1, n)).round(4) for n in sizes]


golden["components"] = [components(layout(s, e)) for s, e in [([6] * 4, 2.0), ([3, 5, 8], 1.5), ([10] * 3, 0.0)]]

with open("golden.json", "w") as file:
    file.write("{\n" + ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in golden.items()) + "\n}\n")
