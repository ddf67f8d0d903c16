//! A tree of boxes over the solids of a scene, so that a ray looks at few of them.

use super::shape::Ray;
use super::vector::{V3, least, most, v3};

/// A box along the axes of the scene.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    pub low: V3,
    pub high: V3,
}

impl Bounds {
    const NONE: Bounds = Bounds { low: v3(1e30, 1e30, 1e30), high: v3(-1e30, -1e30, -1e30) };

    fn join(self, o: Bounds) -> Bounds {
        Bounds { low: self.low.least(o.low), high: self.high.most(o.high) }
    }

    fn centre(&self, axis: usize) -> f32 {
        self.low.axis(axis) + self.high.axis(axis)
    }

    fn area(&self) -> f32 {
        let s = self.high - self.low;
        s.x * s.y + s.y * s.z + s.z * s.x
    }

    /// Where the ray enters the box, if it does so nearer than `far`.
    fn enter(&self, ray: &Ray, far: f32) -> Option<f32> {
        let (a, b) = ((self.low - ray.o) * ray.inverse, (self.high - ray.o) * ray.inverse);
        let (near, leave) = (a.least(b), a.most(b));
        let t = most(most(near.x, near.y), most(near.z, 0.0));
        let end = least(least(leave.x, leave.y), least(leave.z, far));
        (t <= end).then_some(t)
    }
}

#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds,
    /// Of a leaf: the first item; of a fork: the second branch (the first follows the fork).
    link: u32,
    /// Items of a leaf; 0 for a fork.
    count: u32,
}

/// The tree; see [`Bvh::build`].
#[derive(Debug, Clone, Default)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Solids in the order of the leaves.
    order: Vec<u32>,
}

const LEAF: usize = 1;
/// Deeper than any tree that halves at least a hundredth off each time.
const DEPTH: usize = 64;

impl Bvh {
    /// The tree over boxes, by the surface area heuristic (Goldsmith and Salmon 1987).
    pub fn build(boxes: &[Bounds]) -> Self {
        let mut tree = Bvh { nodes: Vec::new(), order: (0..boxes.len() as u32).collect() };
        if !boxes.is_empty() {
            tree.grow(boxes, 0, boxes.len(), 0);
        }
        tree
    }

    fn grow(&mut self, boxes: &[Bounds], from: usize, to: usize, depth: usize) {
        let all = self.order[from..to].iter().fold(Bounds::NONE, |b, &i| b.join(boxes[i as usize]));
        let at = self.nodes.len();
        self.nodes.push(Node { bounds: all, link: from as u32, count: (to - from) as u32 });
        if to - from <= LEAF || depth + 8 >= DEPTH {
            return;
        }
        let middle = from + split(boxes, &mut self.order[from..to]);
        self.grow(boxes, from, middle, depth + 1);
        let second = self.nodes.len() as u32;
        self.nodes[at].link = second;
        self.nodes[at].count = 0;
        self.grow(boxes, middle, to, depth + 1);
    }

    /// Shows `visit` the items whose boxes the ray crosses, roughly from near to far; `visit` gives
    /// back the distance beyond which nothing is of interest any more, below 0 to end.
    pub fn walk(&self, ray: &Ray, mut far: f32, mut visit: impl FnMut(u32, f32) -> f32) {
        if self.nodes.first().and_then(|root| root.bounds.enter(ray, far)).is_none() {
            return;
        }
        let (mut stack, mut height, mut at) = ([(0u32, 0f32); DEPTH], 0, 0u32);
        loop {
            let node = self.nodes[at as usize];
            let mut next = None;
            if node.count > 0 {
                for &item in &self.order[node.link as usize..(node.link + node.count) as usize] {
                    far = visit(item, far);
                }
                if far < 0.0 {
                    return;
                }
            } else {
                let (a, b) = (at + 1, node.link);
                let enter = |i: u32| self.nodes[i as usize].bounds.enter(ray, far);
                next = match (enter(a), enter(b)) {
                    (Some(ta), Some(tb)) => {
                        let (near, other) = if ta <= tb { (a, (b, tb)) } else { (b, (a, ta)) };
                        stack[height] = other;
                        height += 1;
                        Some(near)
                    }
                    (Some(_), None) => Some(a),
                    (None, Some(_)) => Some(b),
                    (None, None) => None,
                };
            }
            at = match next {
                Some(node) => node,
                None => loop {
                    if height == 0 {
                        return;
                    }
                    height -= 1;
                    if stack[height].1 <= far {
                        break stack[height].0;
                    }
                },
            };
        }
    }
}

/// Orders `items` for the cheapest cut and says how many go first.
fn split(boxes: &[Bounds], items: &mut [u32]) -> usize {
    let sort = |items: &mut [u32], axis: usize| {
        items.sort_unstable_by(|&a, &b| {
            let (ca, cb) = (boxes[a as usize].centre(axis), boxes[b as usize].centre(axis));
            ca.total_cmp(&cb).then(a.cmp(&b))
        });
    };
    let n = items.len();
    let (mut best, mut cut) = (f32::INFINITY, (0, n / 2));
    let mut right = vec![0.0f32; n];
    for axis in 0..3 {
        sort(items, axis);
        let mut sum = Bounds::NONE;
        for i in (1..n).rev() {
            sum = sum.join(boxes[items[i] as usize]);
            right[i] = sum.area();
        }
        sum = Bounds::NONE;
        for i in 1..n {
            sum = sum.join(boxes[items[i - 1] as usize]);
            let cost = sum.area() * i as f32 + right[i] * (n - i) as f32;
            if cost < best {
                (best, cut) = (cost, (axis, i));
            }
        }
    }
    sort(items, cut.0);
    cut.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_finds_what_looking_at_every_box_finds() {
        let mut stream = crate::rng::stream(2, "test", &[], "boxes");
        let mut draw = |low: f64, high: f64| stream.range(low, high) as f32;
        let boxes: Vec<Bounds> = (0..300)
            .map(|_| {
                let low = v3(draw(-50.0, 50.0), draw(-5.0, 5.0), draw(-50.0, 50.0));
                Bounds { low, high: low + v3(draw(0.1, 4.0), draw(0.1, 4.0), draw(0.1, 4.0)) }
            })
            .collect();
        let tree = Bvh::build(&boxes);
        for _ in 0..500 {
            let o = v3(draw(-60.0, 60.0), draw(-8.0, 8.0), draw(-60.0, 60.0));
            let ray = Ray::new(o, v3(draw(-1.0, 1.0), draw(-0.1, 0.1), draw(-1.0, 1.0)).unit());
            let plain = boxes.iter().filter_map(|b| b.enter(&ray, 1e9)).fold(1e9f32, f32::min);
            let mut found = 1e9f32;
            tree.walk(&ray, 1e9, |i, far| {
                if let Some(t) = boxes[i as usize].enter(&ray, far) {
                    found = found.min(t);
                }
                found
            });
            assert_eq!(found, plain);
        }
    }
}
