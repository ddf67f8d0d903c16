use super::*;

/// Writes panoramas to look at: `LOOK=street:0-3:1024 cargo test --release -- --ignored look`.
#[test]
#[ignore = "writes images to look at"]
fn look() {
    let wish = std::env::var("LOOK").unwrap_or_else(|_| "street:0-2:1024".into());
    let parts: Vec<&str> = wish.split(':').collect();
    let kind = match parts[0] {
        "room" => SceneKind::Room,
        "land" => SceneKind::Land,
        _ => SceneKind::Street,
    };
    let (from, to) = parts[1].split_once('-').expect("a range");
    let width: u32 = parts[2].parse().expect("a width");
    for index in from.parse::<u32>().expect("from")..=to.parse().expect("to") {
        let start = std::time::Instant::now();
        let pixels = render(20250101, index, kind, width);
        println!("{kind:?} {index}: {:?}", start.elapsed());
        let path = std::env::temp_dir().join(format!("look_{}_{index}.png", kind.as_str()));
        image::save_buffer(path, &pixels, width, width / 2, image::ColorType::Rgb8).expect("saved");
    }
}
