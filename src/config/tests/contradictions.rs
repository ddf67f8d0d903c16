//! Contradictions between keys: each with its line, column and a way out.

use super::{check, refused};
use crate::config::Diagnostic;

#[test]
fn contradictions_that_rules_find() {
    check(&[
        (
            "seed: 1\nsplit: {train: 0.9}\n",
            "study.yaml:2:16: the shares of `split` sum to 1.1, not to 1",
            "e.g. train 0.8",
        ),
        (
            "seed: 1\nsplit: {train: 0.9, validation: 0.09, test: 0.01}\ndataset: {panoramas: {scenes: 40}}\n",
            "study.yaml:3:31: 40 scenes leave none for the subset `test`",
            "raise `split.test`",
        ),
        (
            "seed: 1\ndataset: {panoramas: {source: directory}}\n",
            "study.yaml:2:31: `source: directory` needs the folder's path",
            "path: FOLDER",
        ),
        (
            "seed: 1\ndataset: {panoramas: {source: directory, path: no/such}}\n",
            "study.yaml:2:48: `no/such` is not a folder that can be read",
            "started",
        ),
        (
            "seed: 1\ndataset: {panoramas: {source: directory, path: /, groups: no.csv}}\n",
            "study.yaml:2:59: `/no.csv` is not a file that can be read",
            "leave it out",
        ),
        (
            "seed: 1\ndataset: {panoramas: {path: /}}\n",
            "study.yaml:2:29: `dataset.panoramas.path` is given, but the source is `procedural`, which reads no files",
            "source: directory",
        ),
        (
            "seed: 1\ndataset: {resolution: 200}\n",
            "study.yaml:2:23: `dataset.resolution` 200 is more than panoramas 1024 px wide hold; blur would reveal the focal length",
            "lower it to 97, or make `dataset.panoramas.width` at least 2106",
        ),
        (
            "seed: 1\ndataset: {image_px: 64}\n",
            "study.yaml:2:21: `dataset.resolution` 97 is more than the 64 pixels of a view",
            "lower it",
        ),
        (
            "seed: 1\ndataset: {focal_px: {low: 600}}\n",
            "study.yaml:2:27: `dataset.focal_px.low` 600 is above `high` 500",
            "exchange",
        ),
        (
            "seed: 1\ndataset: {focal_px: {low: 500}}\n",
            "study.yaml:2:27: `dataset.focal_px.low` equals `high`: a focal length that is always the same cannot be learnt",
            "range",
        ),
        (
            "seed: 1\ndataset: {focal_px: {low: 0}}\n",
            "study.yaml:2:27: `dataset.focal_px.low` must be above 0: it is a length in pixels",
            "50",
        ),
        (
            "seed: 1\ndataset: {focal_px: {step: 7}}\n",
            "study.yaml:2:28: `dataset.focal_px.step` 7 does not lead from 50 to 500",
            "498",
        ),
        (
            "seed: 1\ndataset: {focal_px: {step: 0}}\n",
            "study.yaml:2:28: `dataset.focal_px.step` must be above 0",
            "null",
        ),
        (
            "seed: 1\ndataset: {distortion: {low: -0.1, step: null}}\n",
            "study.yaml:2:29: `dataset.distortion.low` is below 0; ξ is the distance of the projection centre from the sphere's",
            "pinhole",
        ),
        (
            "seed: 1\ndataset: {distortion: {high: 6}}\n",
            "study.yaml:2:30: `dataset.distortion.high` must be above 0 and at most 5",
            "1.2",
        ),
        (
            "seed: 1\ndataset: {pose: {pitch_deg: [25, -25]}}\n",
            "study.yaml:2:29: `dataset.pose.pitch_deg` begins at 25 and ends at -25",
            "smaller",
        ),
        (
            "seed: 1\ndataset: {pose: {pitch_deg: [-95, 25]}}\n",
            "study.yaml:2:29: `dataset.pose.pitch_deg` goes beyond ±90 degrees",
            "degrees",
        ),
        (
            "seed: 1\ndataset: {panoramas: {mix: {room: 0, street: 0, land: 0}}}\n",
            "study.yaml:2:28: all shares of `dataset.panoramas.mix` are 0, so there is no scene to make",
            "room: 1",
        ),
        (
            "seed: 1\naugment: {use: none, copies: 3}\n",
            "study.yaml:2:30: `augment.copies` is 3, but no change is allowed, so all copies would be alike",
            "mirror: true",
        ),
        (
            "seed: 1\nbackbone: {tune: 'last:2'}\n",
            "study.yaml:2:18: `backbone.tune: last:2` would train on top of random blocks that stay random",
            "tune: full",
        ),
        (
            "kind: pretraining\nseed: 1\n",
            "study.yaml:1:7: `backbone.tune: frozen` leaves a pretraining nothing to train, or only a part",
            "tune: full",
        ),
        (
            "kind: pretraining\nseed: 1\nbackbone: {tune: full}\nnetwork: {kind: dual_net}\n",
            "study.yaml:4:17: a pretraining trains one backbone, and `network.kind: dual_net` has two",
            "single_net",
        ),
        (
            "seed: 1\nbackbone: {taps: [mixed_5b, mixed_6x]}\n",
            "study.yaml:2:29: inception_v3 has no block `mixed_6x`",
            "did you mean `mixed_6",
        ),
        (
            "seed: 1\nbackbone: {taps: [mixed_5b, mixed_5b]}\n",
            "study.yaml:2:29: the block `mixed_5b` stands here twice",
            "once",
        ),
        (
            "seed: 1\nbackbone: {use: resnet50, taps: [layer3.5, layer3.6]}\n",
            "study.yaml:2:44: resnet50 has no block `layer3.6`",
            "layer3",
        ),
        (
            "seed: 1\nbaseline: {layers: [{units: 9, activation: linear, dropout: 0}]}\n",
            "study.yaml:2:44: a hidden layer cannot be `linear`: it would do nothing that the next layer cannot",
            "relu",
        ),
        (
            "seed: 1\nsearch: {sampler: {use: grid, grid_points: null}}\n",
            "study.yaml:2:44: a grid has no points for `dropout_rate_layer_{i}`, which is continuous",
            "grid_points: 5",
        ),
        (
            "seed: 1\nsearch: {sampler: {use: tpe, group: true}}\n",
            "study.yaml:2:37: `search.sampler.group` models parameters jointly, but `multivariate` is false",
            "multivariate: true",
        ),
        (
            "seed: 1\nsearch: {sampler: {use: evolutionary, population: 2}}\n",
            "study.yaml:2:51: a tournament of 3 is larger than the population of 2",
            "usual",
        ),
        (
            "seed: 1\nsearch: {pruner: {use: threshold, upper: null}}\n",
            "study.yaml:2:42: `search.pruner` has neither `lower` nor `upper`, so it would end no trial",
            "upper: 1.0",
        ),
        (
            "seed: 1\nsearch: {pruner: {use: threshold, lower: 2}}\n",
            "study.yaml:2:42: `search.pruner.lower` 2 is above `upper` 1: every trial would end",
            "exchange",
        ),
        (
            "seed: 1\nsearch: {pruner: {use: patient, wrapped: patient}}\n",
            "study.yaml:2:42: `search.pruner.wrapped` is `patient` itself",
            "another kind",
        ),
        (
            "seed: 1\nsearch: {pruner: {use: hyperband, min_resource: 9, max_resource: 3}}\n",
            "study.yaml:2:49: `search.pruner.min_resource` 9 is above `max_resource` 3",
            "exchange",
        ),
        (
            "seed: 1\nsearch: {pruner: {use: successive_halving, bootstrap: 3}}\n",
            "study.yaml:2:55: `search.pruner.bootstrap` needs a `min_resource`: without one, rungs are not known at the start",
            "number of epochs",
        ),
        (
            "seed: 1\nsearch: {pruner: {use: percentile, percentile: 0}}\n",
            "study.yaml:2:48: `search.pruner.percentile` 0 keeps all trials or none",
            "between 0 and 100",
        ),
        (
            "seed: 1\naugment: {use: none}\nsearch: {space: {use: table_1_extended}}\n",
            "table_1_extended.yaml:27:40: `train.augmentation_strength` is searched, but there are no changed copies for it to act on",
            "2 or more",
        ),
        (
            "seed: 1\nnetwork: {layers: []}\nsearch: {space: {parameters: [{name: n, set: network.layers, type: int, low: 1, high: 2}, {name: 'u{i}', set: 'network.layers.{i}.units', for_each: n, type: int, low: 1, high: 2}, {name: 'a{i}', set: 'network.layers.{i}.activation', for_each: n, type: categorical, choices: [relu]}]}}\n",
            "study.yaml:3:31: the space adds layers to an empty `network.layers`, but nothing gives their `dropout`",
            "network.layers.{i}.dropout",
        ),
    ]);
}

#[test]
fn contradictions_of_a_search_space() {
    let space = |parameters: &str| format!("seed: 1\nsearch:\n  space:\n    parameters:\n{parameters}");
    let one = |text: &str, message: &str, hint: &str| {
        let errors = refused(space(text).as_bytes());
        let fits =
            |d: &Diagnostic| d.to_string().contains(message) && d.hint.as_deref().unwrap_or_default().contains(hint);
        assert!(errors.diagnostics().iter().any(fits), "{text}\nexpected {message} ({hint})\n{}", errors.render(false));
    };
    let rate = "    - {name: a, set: train.learning_rate, type: float, low: 0.1, high: 1}\n";
    one(
        "    - {name: a, set: train.learning_rat, type: float, low: 0.1, high: 1}\n",
        "study.yaml:5:22: there is no key `train.learning_rat` to set",
        "did you mean `learning_rate`?",
    );
    one(
        "    - {name: a, set: dataset.image_px, type: int, low: 64, high: 128}\n",
        "study.yaml:5:22: `dataset.image_px` cannot be searched",
        "train.learning_rate",
    );
    one(
        "    - {name: a, set: train.momentum, type: float, low: 0, high: 1}\n",
        "study.yaml:5:65: high 1 is out of the range of `train.momentum`",
        "from 0 to 0.999",
    );
    one(
        "    - {name: a, set: train.batch_size, type: float, low: 1, high: 9}\n",
        "study.yaml:5:46: `train.batch_size` cannot be a real number",
        "type: int",
    );
    one(
        "    - {name: a, set: train.optimizer, type: categorical, choices: [adam, lion]}\n",
        "study.yaml:5:74: `train.optimizer` cannot be `\"lion\"`",
        "adam, sgd",
    );
    one(
        "    - {name: a, set: train.optimizer, type: categorical}\n",
        "`a` is categorical, but has no choices",
        "choices: [a, b]",
    );
    one("    - {name: a, set: train.learning_rate, type: float}\n", "`a` is a number, but has no low and high", "low:");
    one(
        "    - {name: a, set: train.learning_rate, type: float, low: 0, high: 1, log: true}\n",
        "`log: true` needs low above 0, this is 0",
        "raise low",
    );
    one(
        "    - {name: a, set: train.batch_size, type: int, low: 1, high: 9, step: 3}\n",
        "step 3 does not lead from 1 to 9",
        "last value would be 7",
    );
    one(
        "    - {name: a, set: 'network.layers.{i}.units', type: int, low: 1, high: 9}\n",
        "has no `for_each`",
        "for_each: NAME",
    );
    one(
        "    - {name: 'a{i}', set: 'network.layers.{i}.units', for_each: n, type: int, low: 1, high: 9}\n",
        "`for_each` names `n`, which is no parameter above",
        "parameters above",
    );
    one(
        "    - {name: a, set: network.layers.7.units, type: int, low: 1, high: 9}\n",
        "`network.layers` has no item `7`",
        "for_each",
    );
    one(
        "    - {name: a, set: train.engine, type: categorical, choices: [fused, candle]}\n",
        "`train.engine` changes no result, only how fast it comes",
        "for all trials",
    );
    one(
        "    - {name: a, set: train.schedule.kind, type: categorical, choices: [cosine, step]}\n",
        "`train.schedule.kind` cannot be `\"step\"`",
        "one_cycle",
    );
    one(&format!("{rate}{rate}"), "study.yaml:6:14: a parameter `a` stands above already", "name of its own");
    one(
        &format!(
            "{rate}    - {{name: m, set: train.momentum, type: float, low: 0, high: 0.5, when: {{opt: [sgd]}}}}\n"
        ),
        "`when` names `opt`, which is no parameter above",
        "parameters above: a",
    );
    one(
        &format!("{rate}    - {{name: m, set: train.momentum, type: float, low: 0, high: 0.5, when: {{a: [7]}}}}\n"),
        "`a` never has the value `7`",
        "from 0.1 to 1",
    );
}

#[test]
fn contradictions_of_training() {
    check(&[
        (
            "seed: 1\ntrain: {batch_size: 8, accumulate: 9}\n",
            "study.yaml:2:36: a step of 8 views has no 9 parts",
            "takes all views",
        ),
        (
            "seed: 1\ntrain: {schedule: {kind: plateau, factor: 1.0}}\n",
            "study.yaml:2:43: `train.schedule.factor` is 1, so a plateau would change nothing",
            "kind: constant",
        ),
    ]);
}
