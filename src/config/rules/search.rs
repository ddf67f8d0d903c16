//! Rules of samplers and pruners.

use super::Rules;
use crate::config::spec::{ParameterSpec, ParameterType, PrunerKind, PrunerSpec, SamplerKind, SamplerSpec, SpaceSpec};

pub(super) fn sampler(rules: &mut Rules<'_>, spec: &SamplerSpec, space: Option<&SpaceSpec>) {
    match spec.kind {
        SamplerKind::Tpe if spec.group && !spec.multivariate => {
            let message = "`search.sampler.group` models parameters jointly, but `multivariate` is false";
            rules.refuse("search.sampler.group", message, "write `multivariate: true`, or `group: false`");
        }
        SamplerKind::Grid if spec.grid_points.is_none() => points(rules, space),
        SamplerKind::Evolutionary => tournament(rules, spec),
        SamplerKind::CmaEs => numbers(rules, space),
        _ => {}
    }
}

/// A grid needs a number of points where values cannot be counted.
fn points(rules: &mut Rules<'_>, space: Option<&SpaceSpec>) {
    let continuous = |p: &&ParameterSpec| p.r#type == ParameterType::Float && p.step.is_none() && p.low != p.high;
    if let Some(p) = space.and_then(|s| s.parameters.iter().find(continuous)) {
        let message = format!("a grid has no points for `{}`, which is continuous", p.name);
        let hint = "write `grid_points: 5` in `search.sampler`, or give the parameter a `step`";
        rules.refuse("search.sampler.grid_points search.sampler.kind", message, hint);
    }
}

fn tournament(rules: &mut Rules<'_>, spec: &SamplerSpec) {
    let population = spec.population.unwrap_or(20);
    if spec.tournament > population {
        let message = format!("a tournament of {} is larger than the population of {population}", spec.tournament);
        rules.refuse("search.sampler.tournament search.sampler.population", message, "2 to 5 are usual");
    }
}

/// CMA-ES moves the numbers that every trial has.
fn numbers(rules: &mut Rules<'_>, space: Option<&SpaceSpec>) {
    let shared =
        |p: &ParameterSpec| p.r#type != ParameterType::Categorical && p.for_each.is_none() && p.when.is_empty();
    if space.is_some_and(|s| !s.parameters.iter().any(shared)) {
        let message = "`cma_es` moves numbers that every trial has, and the space has none";
        rules.refuse(
            "search.sampler.kind",
            message,
            "choose `use: tpe`, or add a number without `when` and `for_each`",
        );
    }
}

pub(super) fn pruner(rules: &mut Rules<'_>, spec: &PrunerSpec) {
    of_kind(rules, spec, spec.kind);
    if spec.kind == PrunerKind::Patient {
        if spec.wrapped == PrunerKind::Patient {
            let message = "`search.pruner.wrapped` is `patient` itself";
            rules.refuse("search.pruner.wrapped", message, "name another kind, or `none` to end such trials at once");
        }
        of_kind(rules, spec, spec.wrapped);
    }
}

fn of_kind(rules: &mut Rules<'_>, spec: &PrunerSpec, kind: PrunerKind) {
    match kind {
        PrunerKind::Percentile => percentile(rules, spec),
        PrunerKind::Threshold => bounds(rules, spec),
        PrunerKind::SuccessiveHalving => bootstrap(rules, spec, spec.min_resource, "min_resource"),
        PrunerKind::Hyperband => {
            bootstrap(rules, spec, spec.max_resource, "max_resource");
            resources(rules, spec);
        }
        PrunerKind::Median | PrunerKind::Patient | PrunerKind::Wilcoxon | PrunerKind::None => {}
    }
}

fn percentile(rules: &mut Rules<'_>, spec: &PrunerSpec) {
    if !(spec.percentile > 0.0 && spec.percentile < 100.0) {
        let message = format!("`search.pruner.percentile` {} keeps all trials or none", spec.percentile);
        let hint = "choose a value between 0 and 100, or `use: none` to keep all";
        rules.refuse("search.pruner.percentile", message, hint);
    }
}

fn bounds(rules: &mut Rules<'_>, spec: &PrunerSpec) {
    match (spec.lower, spec.upper) {
        (None, None) => {
            let message = "`search.pruner` has neither `lower` nor `upper`, so it would end no trial";
            rules.refuse("search.pruner.upper search.pruner.kind", message, "add `upper: 1.0`, or choose `use: none`");
        }
        (Some(lower), Some(upper)) if lower > upper => {
            let message = format!("`search.pruner.lower` {lower} is above `upper` {upper}: every trial would end");
            rules.refuse("search.pruner.lower search.pruner.upper", message, "exchange the two");
        }
        _ => {}
    }
}

fn bootstrap(rules: &mut Rules<'_>, spec: &PrunerSpec, resource: Option<u32>, key: &str) {
    if spec.bootstrap > 0 && resource.is_none() {
        let message =
            format!("`search.pruner.bootstrap` needs a `{key}`: without one, rungs are not known at the start");
        rules.refuse(
            "search.pruner.bootstrap",
            message,
            format!("give `{key}` a number of epochs, or write `bootstrap: 0`"),
        );
    }
}

fn resources(rules: &mut Rules<'_>, spec: &PrunerSpec) {
    if let (Some(least), Some(most)) = (spec.min_resource, spec.max_resource)
        && least > most
    {
        let message = format!("`search.pruner.min_resource` {least} is above `max_resource` {most}");
        rules.refuse("search.pruner.min_resource search.pruner.max_resource", message, "exchange the two");
    }
}
