//! Open land: fields, roads, hamlets, woods and water, from eye height or from a mast.

use super::building::{Plan, building};
use super::dice::Dice;
use super::ground::Ground;
use super::land_map::{Crop, Cut, Field, LandMap, Part, Way};
use super::material::{Material, Pattern};
use super::plants::{Species, hedge, hedge_leaves};
use super::props::{self, CarParts};
use super::scene::{Builder, Scene};
use super::shape::{Place, Shape};
use super::sky::Weather;
use super::street::clear_of;
use super::vector::{grey, tint, v3};

/// A convex part of the plane: its corners (x, z) in order.
type Polygon = Vec<(f32, f32)>;

/// What stays the same all over one land.
struct Country {
    dusk: bool,
    high: bool,
    /// The angle of most borders.
    grain: f32,
    /// Area of a field near the camera, in m².
    field: f32,
    /// Middle and radius of a village.
    village: (f32, f32, f32),
    hedges: f32,
    woods: f32,
    wet: f32,
    species: [Species; 3],
    leaves: u16,
    wood: u16,
    cars: CarParts,
    /// Most solids that are built.
    most: usize,
}

/// Scene `index` as open land.
pub fn land(seed: u64, index: u32) -> Scene {
    let mut b = Builder::new(Dice::open(seed, index, "land"));
    let weather = Weather::draw(&mut b.dice);
    let country = country(&mut b, weather.dusk);
    let mut map = map(&mut b);
    let size = 2500.0;
    let whole = vec![(-size, -size), (size, -size), (size, size), (-size, size)];
    map.parts.push(Part::Field(0));
    let mut leaves = Vec::new();
    divide(&mut b.dice, &country, &mut map, (0, whole, 0), &mut leaves);
    leaves.sort_by(|x, y| reach(&x.1).total_cmp(&reach(&y.1)));
    for (field, polygon) in &leaves {
        if b.solids.len() < country.most {
            fill(&mut b, &country, &map.fields[*field as usize], polygon);
        }
    }
    horizon(&mut b);
    if !country.high {
        foreground(&mut b, &country);
    }
    let height = if country.high { b.dice.log(18.0, 120.0) } else { b.dice.f(1.3, 3.5) };
    let eye = clear_of(&b, v3(0.0, height, 0.0));
    Scene::assemble(b, weather, Ground::Land(Box::new(map)), eye)
}

fn country(b: &mut Builder, dusk: bool) -> Country {
    let (c, s) = b.dice.turn();
    let high = b.dice.chance(0.55);
    let far = if high { b.dice.f(0.0, 220.0) } else { b.dice.f(0.0, 90.0) };
    let village = if b.dice.chance(0.7) { (c * far, s * far, b.dice.f(60.0, 220.0)) } else { (0.0, 0.0, 0.0) };
    let brown = b.dice.near(tint(0.45, 0.36, 0.26), 0.3);
    Country {
        dusk,
        high,
        grain: b.dice.f(0.0, core::f32::consts::PI),
        field: if high { b.dice.log(1500.0, 16000.0) } else { b.dice.log(500.0, 4000.0) },
        village,
        hedges: b.dice.f(0.1, 0.8),
        woods: b.dice.f(0.02, 0.2),
        wet: b.dice.f(0.0, 0.12),
        species: [Species::draw(b), Species::draw(b), Species::draw(b)],
        leaves: hedge_leaves(b),
        wood: b.paint(brown),
        cars: CarParts::new(b, dusk),
        most: 5000,
    }
}

fn map(b: &mut Builder) -> LandMap {
    let seed = b.dice.seed();
    let green = b.dice.near(tint(0.38, 0.46, 0.2), 0.25);
    let dry = b.dice.near(tint(0.55, 0.5, 0.28), 0.2);
    LandMap {
        parts: Vec::new(),
        fields: Vec::new(),
        grass: Material::new(Pattern::Mottle(1.5), green, dry, seed).rough(0.3, 0.4),
        tarmac: grey(b.dice.f(0.06, 0.2)),
        gravel: b.dice.near(tint(0.62, 0.56, 0.46), 0.25),
        water: b.dice.near(tint(0.16, 0.22, 0.22), 0.4),
        seed,
    }
}

/// Distance of a polygon's centre from the origin.
fn reach(polygon: &Polygon) -> f32 {
    let (x, z) = centre(polygon);
    (x * x + z * z).sqrt()
}

fn centre(polygon: &Polygon) -> (f32, f32) {
    let n = polygon.len() as f32;
    let sum = polygon.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
    (sum.0 / n, sum.1 / n)
}

fn area(polygon: &Polygon) -> f32 {
    let pairs = polygon.iter().zip(polygon.iter().cycle().skip(1));
    0.5 * pairs.map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum::<f32>().abs()
}

/// The part of a polygon where x·nx + z·nz < offset.
fn clip(polygon: &Polygon, (nx, nz): (f32, f32), offset: f32) -> Polygon {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (dp, dq) = (p.0 * nx + p.1 * nz - offset, q.0 * nx + q.1 * nz - offset);
        if dp < 0.0 {
            out.push(p);
        }
        if (dp < 0.0) != (dq < 0.0) {
            let t = dp / (dp - dq);
            out.push((p.0 + t * (q.0 - p.0), p.1 + t * (q.1 - p.1)));
        }
    }
    out
}

/// Divides part `at` of the map, a polygon, until its pieces are small for their distance.
fn divide(
    dice: &mut Dice,
    country: &Country,
    map: &mut LandMap,
    (at, polygon, depth): (usize, Polygon, u32),
    leaves: &mut Vec<(u32, Polygon)>,
) {
    let (x, z) = centre(&polygon);
    let (vx, vz, radius) = country.village;
    let in_village = (x - vx) * (x - vx) + (z - vz) * (z - vz) < radius * radius;
    let far = (x * x + z * z).sqrt();
    let goal = if in_village { 800.0 } else { country.field + 0.06 * far * far };
    let size = area(&polygon);
    if size < goal * dice.f(0.8, 1.7) || depth > 15 {
        let field = field(dice, country, in_village, size, (x, z), far);
        map.fields.push(field);
        let number = map.fields.len() as u32 - 1;
        map.parts[at] = Part::Field(number);
        leaves.push((number, polygon));
        return;
    }
    let cut = cut(dice, country, &polygon, (size / goal, depth));
    let low = clip(&polygon, cut.n, cut.offset - cut.half);
    let high = clip(&polygon, (-cut.n.0, -cut.n.1), -cut.offset - cut.half);
    let below = map.parts.len() as u32;
    map.parts.extend([Part::Field(0), Part::Field(0)]);
    map.parts[at] = Part::Cut { cut, below, above: below + 1 };
    for (i, piece) in [(below, low), (below + 1, high)] {
        let piece = if piece.len() < 3 { polygon.clone() } else { piece };
        let depth = if area(&piece) < 20.0 { 99 } else { depth + 1 };
        divide(dice, country, map, (i as usize, piece, depth), leaves);
    }
}

/// A cut across the polygon's longer extent, its way by how much there is still to divide.
fn cut(dice: &mut Dice, country: &Country, polygon: &Polygon, (left, depth): (f32, u32)) -> Cut {
    let skew = if dice.chance(0.7) { dice.f(-0.06, 0.06) } else { dice.f(-0.6, 0.6) };
    let angle = country.grain + skew;
    let (c, s) = (libm::cosf(angle), libm::sinf(angle));
    let extent = |n: (f32, f32)| {
        let along = polygon.iter().map(|p| p.0 * n.0 + p.1 * n.1);
        along.fold((f32::MAX, f32::MIN), |e, x| (e.0.min(x), e.1.max(x)))
    };
    let (one, other) = (extent((c, s)), extent((-s, c)));
    let n = if (one.1 - one.0 > other.1 - other.0) != dice.chance(0.12) { (c, s) } else { (-s, c) };
    let (low, high) = extent(n);
    let mut offset = low + (high - low) * dice.f(0.32, 0.68);
    let way = if depth < 4 && left > 4.0 && dice.chance(country.wet) {
        Way::Water
    } else if left > 5.0 && dice.chance(if depth < 6 { 0.35 } else { 0.6 }) {
        Way::Road
    } else if dice.chance(0.35) {
        Way::Track
    } else {
        Way::Verge
    };
    // The first cuts pass near the camera, so that a road is often close.
    if depth < 2 {
        offset = dice.f(-40.0, 40.0);
    }
    let half = match way {
        Way::Verge => dice.f(0.3, 1.6),
        Way::Track => dice.f(1.4, 2.2),
        Way::Road => dice.f(3.2, 6.0),
        Way::Water => dice.f(3.0, 16.0),
    };
    Cut { n, offset: offset.clamp(low, high), half, way }
}

fn field(dice: &mut Dice, country: &Country, village: bool, size: f32, at: (f32, f32), far: f32) -> Field {
    let crop = if village && dice.chance(0.8) {
        Crop::Lot
    } else if dice.chance(country.woods) {
        Crop::Wood
    } else if dice.chance(0.5 * country.wet) {
        Crop::Lake
    } else {
        match dice.below(14) {
            0..=2 => Crop::Meadow,
            3..=5 => Crop::Rows(dice.log(0.7, 4.0)),
            6..=8 => Crop::Corn(dice.f(12.0, 28.0)),
            9 => Crop::Strips(dice.f(3.0, 15.0)),
            10 => Crop::Orchard(dice.f(4.0, 8.0)),
            11 if size > 6000.0 && far < 500.0 => Crop::Pitch,
            12 if size < 6000.0 => Crop::Parking,
            13 => Crop::Solar,
            _ => Crop::Lot,
        }
    };
    let green = (tint(0.36, 0.48, 0.18), tint(0.5, 0.55, 0.25));
    let pairs = [
        green,
        (tint(0.28, 0.4, 0.16), tint(0.45, 0.36, 0.26)),
        (tint(0.75, 0.65, 0.36), tint(0.55, 0.45, 0.28)),
        (tint(0.46, 0.36, 0.27), tint(0.36, 0.28, 0.2)),
        (tint(0.82, 0.76, 0.2), tint(0.5, 0.52, 0.16)),
    ];
    let (a, b) =
        if matches!(crop, Crop::Rows(_) | Crop::Corn(_) | Crop::Strips(_)) { dice.pick(&pairs) } else { green };
    let quarter = if dice.chance(0.5) { 0.0 } else { core::f32::consts::FRAC_PI_2 };
    let angle = country.grain + quarter + dice.f(-0.05, 0.05);
    let along = (libm::cosf(angle), libm::sinf(angle));
    Field { crop, along, centre: at, a: dice.near(a, 0.25), b: dice.near(b, 0.25), seed: dice.seed() }
}

/// Stands what belongs to a field on it.
fn fill(b: &mut Builder, country: &Country, field: &Field, polygon: &Polygon) {
    let far = reach(polygon);
    if far < 700.0 {
        borders(b, country, polygon, far);
    }
    match field.crop {
        Crop::Wood if far < 900.0 => trees(b, country, field, polygon, 7.0 + 0.02 * far),
        Crop::Orchard(step) if far < 350.0 => trees(b, country, field, polygon, step + 0.02 * far),
        Crop::Lot if far < 900.0 => lot(b, country, field, polygon, far),
        Crop::Parking if far < 400.0 => parked(b, country, field, polygon),
        Crop::Solar if far < 300.0 => solar(b, field, polygon),
        Crop::Corn(_) | Crop::Meadow if far < 250.0 && b.dice.chance(0.35) => bales(b, field, polygon),
        _ => {}
    }
    if b.dice.chance(0.012) && (60.0..600.0).contains(&far) {
        let material = b.paint(grey(0.7));
        let turn = b.dice.turn();
        props::mast(b, &Place::new(v3(field.centre.0, 0.0, field.centre.1), turn), material);
    }
}

/// Hedges, fences or rows of trees along a field's border.
fn borders(b: &mut Builder, country: &Country, polygon: &Polygon, far: f32) {
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (from, to) = (v3(p.0, 0.0, p.1), v3(q.0, 0.0, q.1));
        let near = distance(p, q);
        if near < 3.0 || !b.dice.chance(country.hedges) {
            continue;
        }
        match b.dice.below(4) {
            0 | 1 => {
                let height = b.dice.f(0.8, 2.6);
                hedge(b, from, to, height, country.leaves);
            }
            2 if near < 90.0 => {
                let spacing = b.dice.f(2.0, 4.0);
                props::fence(b, from, to, 1.2, spacing, country.wood);
            }
            _ => {
                let length = (to - from).length();
                let step = b.dice.f(7.0, 16.0) + 0.03 * far;
                let species = b.dice.pick(&country.species);
                for k in 0..(length / step) as u32 {
                    let at = from.mix(to, (k as f32 + 0.5) * step / length);
                    let height = b.dice.f(5.0, 14.0);
                    if at.length() > 4.0 {
                        species.plant(b, at, height, if far < 120.0 { 8 } else { 3 });
                    }
                }
            }
        }
    }
}

/// Distance of the segment from the origin.
fn distance(p: (f32, f32), q: (f32, f32)) -> f32 {
    let (dx, dz) = (q.0 - p.0, q.1 - p.1);
    let t = (-(p.0 * dx + p.1 * dz) / (dx * dx + dz * dz).max(1e-6)).clamp(0.0, 1.0);
    let (x, z) = (p.0 + t * dx, p.1 + t * dz);
    (x * x + z * z).sqrt()
}

/// The points of a grid along the field's rows that lie at least `margin` within the polygon.
fn grid(field: &Field, polygon: &Polygon, (du, dv): (f32, f32), margin: f32, most: usize) -> Vec<(f32, f32)> {
    let (c, s) = field.along;
    let radius = polygon.iter().map(|p| range(p.0 - field.centre.0, p.1 - field.centre.1)).fold(0.0, f32::max);
    let (nu, nv) = ((radius / du) as i32, (radius / dv) as i32);
    let mut out = Vec::new();
    for i in -nu..=nu {
        for j in -nv..=nv {
            let (u, v) = (i as f32 * du, j as f32 * dv);
            let p = (field.centre.0 + c * u - s * v, field.centre.1 + s * u + c * v);
            if out.len() < most && inside(polygon, p, margin) {
                out.push(p);
            }
        }
    }
    out
}

/// Distance of (x, z) from the origin.
fn range(x: f32, z: f32) -> f32 {
    (x * x + z * z).sqrt()
}

fn inside(polygon: &Polygon, p: (f32, f32), margin: f32) -> bool {
    let c = centre(polygon);
    polygon.iter().enumerate().all(|(i, &a)| {
        let b = polygon[(i + 1) % polygon.len()];
        let (dx, dz) = (b.0 - a.0, b.1 - a.1);
        let length = range(dx, dz).max(1e-6);
        let side = |q: (f32, f32)| ((q.0 - a.0) * dz - (q.1 - a.1) * dx) / length;
        side(p) * side(c).signum() > margin
    })
}

fn trees(b: &mut Builder, country: &Country, field: &Field, polygon: &Polygon, step: f32) {
    let orchard = matches!(field.crop, Crop::Orchard(_));
    let near = reach(polygon) < 80.0;
    let species = b.dice.pick(&country.species);
    for (x, z) in grid(field, polygon, (step, step), 1.5, 160) {
        let loose = if orchard { 0.1 } else { 0.35 * step };
        let at = v3(x + b.dice.f(-loose, loose), 0.0, z + b.dice.f(-loose, loose));
        let height = if orchard { b.dice.f(2.5, 4.0) } else { b.dice.f(8.0, 20.0) };
        if at.length() > 5.0 {
            let kind = if orchard || b.dice.chance(0.7) { species } else { country.species[1] };
            kind.plant(b, at, height, if near { 6 } else { 2 });
        }
    }
}

/// A house in its garden: drive, shed, trees, a car.
fn lot(b: &mut Builder, country: &Country, field: &Field, polygon: &Polygon, far: f32) {
    let turn = (field.along.0, -field.along.1);
    let (x, z) = field.centre;
    if range(x, z) < 14.0 {
        return;
    }
    let size = area(polygon).sqrt();
    let (width, depth) =
        ((size * b.dice.f(0.3, 0.45)).clamp(7.0, 26.0), (size * b.dice.f(0.22, 0.32)).clamp(6.0, 13.0));
    let place = Place::new(v3(x, 0.0, z), turn);
    let front = place.child(v3(0.0, 0.0, -0.5 * depth), (1.0, 0.0));
    let plan = Plan { width, depth, storeys: b.dice.int(1, 3), shops: false, dusk: country.dusk, detail: far < 60.0 };
    building(b, &front, &plan);
    let grey_level = b.dice.f(0.12, 0.4);
    let slab = b.paint(grey(grey_level));
    b.block(&place, v3(0.3 * width, 0.02, -0.5 * depth - 3.5), v3(3.2, 0.05, 7.0), slab);
    if b.dice.chance(0.7) && far < 250.0 {
        props::car(b, &country.cars, &place.child(v3(0.3 * width, 0.04, -0.5 * depth - 3.5), (0.0, 1.0)));
    }
    if b.dice.chance(0.5) {
        let size = v3(b.dice.f(2.5, 6.0), b.dice.f(2.2, 3.2), b.dice.f(2.5, 5.0));
        b.block(&place, v3(-0.5 * width - 3.0, 0.5 * size.y, 2.0), size, country.wood);
    }
    for _ in 0..b.dice.below(4) {
        let at = place.at(v3(b.dice.sign() * (0.5 * width + b.dice.f(2.0, 5.0)), 0.0, b.dice.f(-8.0, 8.0)));
        let species = b.dice.pick(&country.species);
        let height = b.dice.f(3.0, 9.0);
        species.plant(b, at, height, if far < 80.0 { 6 } else { 2 });
    }
}

fn parked(b: &mut Builder, country: &Country, field: &Field, polygon: &Polygon) {
    let full = b.dice.f(0.1, 0.8);
    let (c, s) = field.along;
    for (x, z) in grid(field, polygon, (2.5, 16.0), 3.0, 80) {
        for row in [2.5, 7.5] {
            if b.dice.chance(full) {
                // Between the lines: half a bay on, and into the row.
                let at = v3(x + c * 1.3 - s * row, 0.0, z + s * 1.3 + c * row);
                let heading = if b.dice.chance(0.5) { (s, c) } else { (-s, -c) };
                props::car(b, &country.cars, &Place::new(at, (-heading.0, -heading.1)));
            }
        }
    }
}

fn solar(b: &mut Builder, field: &Field, polygon: &Polygon) {
    let seed = b.dice.seed();
    let (w, h) = (b.dice.f(1.0, 1.7), b.dice.f(1.0, 1.7));
    let cells = Pattern::Bricks { w, h, joint: 0.05, shift: 0.0 };
    let panel = b.material(Material::new(cells, tint(0.1, 0.14, 0.3), grey(0.5), seed).shiny(0.25));
    for (x, z) in grid(field, polygon, (9.2, 6.5), 5.0, 120) {
        let place = Place::new(v3(x, 1.2, z), (field.along.0, -field.along.1));
        b.add(place, Shape::Gable(v3(4.5, 0.5, 1.6)), panel, panel);
    }
}

fn bales(b: &mut Builder, field: &Field, polygon: &Polygon) {
    let seed = b.dice.seed();
    let straw = Pattern::Bars { period: 0.12, share: 0.4, across: false };
    let straw = b.material(Material::new(straw, tint(0.78, 0.68, 0.42), tint(0.6, 0.5, 0.28), seed).rough(0.3, 0.2));
    let round = b.dice.chance(0.5);
    for (x, z) in grid(field, polygon, (b.dice.f(9.0, 25.0), b.dice.f(12.0, 30.0)), 3.0, 40) {
        if range(x, z) < 3.0 {
            continue;
        }
        let place = Place::new(v3(x, 0.7, z), b.dice.turn());
        if round {
            b.add(place, Shape::Axle(v3(0.6, 0.7, 0.7)), straw, straw);
        } else {
            b.add(place, Shape::Block(v3(1.1, 0.5, 0.6)), straw, straw);
        }
    }
}

/// What stands close to a camera at eye height: straight fences, a path of slabs, a seat, a car.
fn foreground(b: &mut Builder, country: &Country) {
    let (c, s) = b.dice.turn();
    let metal = b.paint(grey(0.1));
    for _ in 0..b.dice.int(1, 3) {
        let (aside, reach) = (b.dice.sign() * b.dice.f(1.5, 9.0), b.dice.f(15.0, 60.0));
        let at = |along: f32| v3(c * along - s * aside, 0.0, s * along + c * aside);
        let (height, spacing) = (b.dice.f(0.9, 1.6), b.dice.f(1.8, 3.5));
        props::fence(b, at(-reach), at(reach), height, spacing, country.wood);
    }
    let (seed, w, h) = (b.dice.seed(), b.dice.f(0.3, 1.0), b.dice.f(0.3, 0.9));
    let stone = b.dice.near(tint(0.62, 0.6, 0.55), 0.25);
    let slabs = Pattern::Bricks { w, h, joint: 0.02, shift: b.dice.pick(&[0.0, 0.5]) };
    let slabs = b.material(Material::new(slabs, stone, stone * 0.35, seed).rough(0.2, 0.8));
    let place = Place::new(v3(0.0, 0.0, 0.0), (c, -s));
    if b.dice.chance(0.6) {
        let (aside, wide) = (b.dice.f(-3.0, 3.0), b.dice.f(1.0, 4.5));
        let long = b.dice.f(20.0, 80.0);
        b.block(&place, v3(0.0, 0.02, aside), v3(long, 0.06, wide), slabs);
    }
    for _ in 0..b.dice.int(1, 5) {
        let at = place.at(v3(b.dice.sign() * b.dice.f(2.5, 14.0), 0.0, b.dice.sign() * b.dice.f(2.0, 8.0)));
        let spot = Place::new(at, b.dice.turn());
        match b.dice.below(4) {
            0 => props::car(b, &country.cars, &spot),
            1 => props::bench(b, &spot, country.wood, metal),
            2 => props::sign(b, &spot, metal),
            _ => {
                let size = v3(b.dice.f(1.5, 5.0), b.dice.f(0.8, 2.6), b.dice.f(1.2, 3.0));
                b.block(&spot, v3(0.0, 0.5 * size.y, 0.0), size, slabs);
                b.block(&spot, v3(0.0, size.y, 0.0), v3(size.x + 0.3, 0.1, size.z + 0.3), country.wood);
            }
        }
    }
}

/// Hills beyond the fields.
fn horizon(b: &mut Builder) {
    let green = b.dice.near(tint(0.32, 0.4, 0.24), 0.3);
    let seed = b.dice.seed();
    let hill = b.material(Material::new(Pattern::Mottle(180.0), green, green * 0.45, seed).rough(0.3, 60.0));
    for _ in 0..b.dice.below(14) {
        let (c, s) = b.dice.turn();
        let far = b.dice.f(2200.0, 7000.0);
        let (wide, tall) = (b.dice.f(500.0, 1400.0), b.dice.f(40.0, 380.0));
        let place = Place::new(v3(c * far, -10.0, s * far), b.dice.turn());
        b.add(place, Shape::Ball(v3(wide, tall, 0.6 * wide)), hill, hill);
    }
}
