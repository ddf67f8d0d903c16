pub struct LandMap;
impl LandMap { pub fn look(&self, _s: &super::material::Spot) -> super::material::Look { unimplemented!() } }
