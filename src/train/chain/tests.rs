use super::difference::ulps;
use super::*;

const LINES: &[&str] = &[
    "step 0 0 0123456789abcdef 3fd5555555555555",
    "step 0 1 fedcba9876543210 3fd0000000000000",
    "tensor 0 layer0.weight aa",
    "optimizer 0 bb",
    "state 0 cc",
    "validation 0 3fe0000000000000",
    "end 1 0 early",
];

/// A chain of these lines, with their links.
fn text(lines: &[impl AsRef<str>]) -> String {
    let mut text = FORMAT.to_owned();
    for line in lines {
        let link = link_to(text.lines().last().unwrap());
        text.push_str(&format!("\n{} {link}", line.as_ref()));
    }
    text + "\n"
}

fn chain(lines: &[impl AsRef<str>]) -> Chain {
    Chain::parse(&text(lines)).unwrap()
}

/// The first difference from the usual lines if line `at` is another.
fn changed(at: usize, line: &str) -> Difference {
    let mut lines = LINES.to_vec();
    lines[at] = line;
    Chain::first_difference(&chain(LINES), &chain(&lines)).unwrap()
}

#[test]
fn every_line_is_read_as_it_was_written() {
    let read = chain(LINES);
    let written: Vec<String> = read.lines.iter().map(|line| line.entry.to_string()).collect();
    assert_eq!(written, LINES);
    assert_eq!((read.epochs(), read.end(), read.broken_link()), (1, Some("early"), None));
    assert_eq!(Chain::first_difference(&read, &read), None);
}

#[test]
fn what_is_no_chain_is_refused() {
    for wrong in ["", "panotune steps 2\n", "panotune steps 1\nstep 0\n", "panotune steps 1\nstep 0 0 aa 12 link\n"] {
        assert!(Chain::parse(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn a_link_that_does_not_hold_is_seen() {
    let text = text(LINES).replace("fedcba", "fedcbb");
    assert_eq!(Chain::parse(&text).unwrap().broken_link(), Some(4));
    assert_eq!(Chain::parse(&text.replacen("step 0 0 0123", "step 0 0 0124", 1)).unwrap().broken_link(), Some(3));
}

#[test]
fn differences_are_named_with_their_place() {
    let loss = changed(1, "step 0 1 fedcba9876543210 3fd0000000000002");
    assert_eq!((loss.epoch, loss.step, loss.what, loss.ulps), (0, Some(1), What::Loss, Some(2)));
    let rows = changed(1, "step 0 1 fedcba9876543211 3fd0000000000002");
    assert_eq!((rows.step, rows.what, rows.ulps), (Some(1), What::Rows, None));
    let tensor = changed(2, "tensor 0 layer0.weight ab");
    assert_eq!((tensor.epoch, tensor.step, &tensor.what), (0, None, &What::Tensor("layer0.weight".to_owned())));
    assert_eq!(tensor.to_string(), "epoch 0: tensor `layer0.weight` is ab, and was aa");
    assert_eq!(changed(3, "optimizer 0 ab").what, What::Optimizer);
    assert_eq!(changed(4, "state 0 ab").what, What::State);
    assert_eq!(changed(5, "validation 0 3fe0000000000001").what, What::ValidationLoss);
    assert_eq!(changed(6, "end 1 0 pruned").what, What::End);
    let (all, less) = (chain(LINES), chain(&LINES[..3]));
    let ends = [Chain::first_difference(&all, &less), Chain::first_difference(&less, &all)];
    assert!(ends.iter().flatten().all(|d| (d.epoch, &d.what) == (0, &What::End)) && ends.iter().all(Option::is_some));
}

#[test]
fn with_tolerance_only_losses_that_are_far_apart_differ() {
    let recorded = chain(LINES);
    let found = |at, now: &str| difference::at(&recorded, at, &Entry::parse(now).unwrap(), Exactness::Tolerance);
    assert_eq!(found(1, "step 0 1 fedcba9876543210 3fd0000000010000"), None);
    assert_eq!(found(2, "tensor 0 layer0.weight ab"), None);
    assert_eq!(found(3, "optimizer 0 ab"), None);
    assert_eq!(found(1, "step 0 1 fedcba9876543210 3fd0100000000000").unwrap().what, What::Loss);
    assert_eq!(found(1, "step 0 1 fedcba9876543211 3fd0000000000000").unwrap().what, What::Rows);
    assert_eq!(found(1, "step 0 1 fedcba9876543210 7ff8000000000000").unwrap().what, What::Loss);
}

#[test]
fn distances_count_representable_numbers() {
    let bits = |x: f64| x.to_bits();
    assert_eq!(ulps(bits(1.0), bits(1.0 + f64::EPSILON)), 1);
    assert_eq!(ulps(bits(0.0), bits(-0.0)), 0);
    assert_eq!(ulps(bits(-f64::from_bits(1)), bits(f64::from_bits(2))), 3);
}
