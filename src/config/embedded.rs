//! The pieces of `configs/`, built into the program, so that it works from any folder.

/// The paper's published figures.
pub(super) const PUBLISHED: &str = include_str!("../../configs/paper/published.yaml");

/// Path below `configs/`, and text.
pub(super) const EMBEDDED: &[(&str, &str)] = &[
    ("augment/none.yaml", include_str!("../../configs/augment/none.yaml")),
    ("augment/paper.yaml", include_str!("../../configs/augment/paper.yaml")),
    ("backbone/inception_v3.yaml", include_str!("../../configs/backbone/inception_v3.yaml")),
    ("backbone/mobilenet_v1.yaml", include_str!("../../configs/backbone/mobilenet_v1.yaml")),
    ("backbone/resnet50.yaml", include_str!("../../configs/backbone/resnet50.yaml")),
    ("baseline/aerocalib.yaml", include_str!("../../configs/baseline/aerocalib.yaml")),
    ("dataset/nadir.yaml", include_str!("../../configs/dataset/nadir.yaml")),
    ("dataset/wide_angle.yaml", include_str!("../../configs/dataset/wide_angle.yaml")),
    ("evaluation/default.yaml", include_str!("../../configs/evaluation/default.yaml")),
    ("network/single_net.yaml", include_str!("../../configs/network/single_net.yaml")),
    ("network/single_net_decoupled.yaml", include_str!("../../configs/network/single_net_decoupled.yaml")),
    ("paper/published.yaml", include_str!("../../configs/paper/published.yaml")),
    ("profile/desk.yaml", include_str!("../../configs/profile/desk.yaml")),
    ("profile/paper.yaml", include_str!("../../configs/profile/paper.yaml")),
    ("profile/smoke.yaml", include_str!("../../configs/profile/smoke.yaml")),
    ("profile/tiny.yaml", include_str!("../../configs/profile/tiny.yaml")),
    ("pruner/median.yaml", include_str!("../../configs/pruner/median.yaml")),
    ("pruner/none.yaml", include_str!("../../configs/pruner/none.yaml")),
    ("pruner/percentile.yaml", include_str!("../../configs/pruner/percentile.yaml")),
    ("report/default.yaml", include_str!("../../configs/report/default.yaml")),
    ("sampler/default.yaml", include_str!("../../configs/sampler/default.yaml")),
    ("sampler/optuna-4.9.yaml", include_str!("../../configs/sampler/optuna-4.9.yaml")),
    ("sampler/random.yaml", include_str!("../../configs/sampler/random.yaml")),
    ("sampler/tpe.yaml", include_str!("../../configs/sampler/tpe.yaml")),
    ("search/default.yaml", include_str!("../../configs/search/default.yaml")),
    ("space/table_1.yaml", include_str!("../../configs/space/table_1.yaml")),
    ("space/table_1_extended.yaml", include_str!("../../configs/space/table_1_extended.yaml")),
    ("split/by_group.yaml", include_str!("../../configs/split/by_group.yaml")),
    ("split/by_panorama.yaml", include_str!("../../configs/split/by_panorama.yaml")),
    ("train/head.yaml", include_str!("../../configs/train/head.yaml")),
];
