//! The unified spherical camera model: project, unproject, field of view, valid region.
//!
//! A point (X, Y, Z), x to the right, y down, z forward, is put on the unit sphere and projected
//! from a centre ξ behind the sphere's own, with focal length f. ξ = 0 is the pinhole camera, ξ = 1 the
//! stereographic projection. Equations: `paper/CORRECTIONS.md`, which corrects those of the paper.
//!
//! **Pixel coordinates.** The top left *corner* of the image is (0, 0) and the centre of the first
//! pixel (0.5, 0.5), so an image of W × H pixels has its centre at (W/2, H/2). COLMAP writes the same
//! numbers. OpenCV, Kalibr and ROS put the centre of the first pixel at (0, 0): their principal point
//! is ours minus 0.5, c − 0.5. Nothing but an exporter may use another convention.

#[cfg(test)]
mod tests;

/// A camera of the unified spherical model. Lengths are in pixels of one image size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Focal length f > 0 in pixels. The scale at the image centre is f/(1 + ξ) pixels per radian.
    pub f: f64,
    /// Distortion ξ ≥ 0, dimensionless.
    pub xi: f64,
    /// Principal point, horizontally, in pixels from the left edge.
    pub u0: f64,
    /// Principal point, vertically, in pixels from the upper edge.
    pub v0: f64,
}

impl Camera {
    /// A camera whose principal point is the centre of a square image of `side` pixels.
    pub fn centred(f: f64, xi: f64, side: u32) -> Self {
        let centre = f64::from(side) / 2.0;
        Self { f, xi, u0: centre, v0: centre }
    }

    /// Where a point appears, in pixels; its distance does not matter.
    ///
    /// `None` where the model is not one to one, Z/d ≤ −min(ξ, 1/ξ) with d the point's distance, and
    /// for the centre itself.
    pub fn project(&self, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        let d = (x * x + y * y + z * z).sqrt();
        if z <= self.lowest_cosine() * d {
            return None;
        }
        let depth = self.xi * d + z;
        (depth > 0.0).then(|| [self.f * x / depth + self.u0, self.f * y / depth + self.v0])
    }

    /// The unit ray seen at (`u`, `v`) pixels, which may lie outside the image.
    ///
    /// `None` where 1 + (1 − ξ²)r² < 0, r being the distance from the principal point over f; that
    /// happens for ξ > 1 only.
    pub fn unproject(&self, u: f64, v: f64) -> Option<[f64; 3]> {
        let (x, y) = ((u - self.u0) / self.f, (v - self.v0) / self.f);
        let eta = self.eta(x * x + y * y)?;
        Some([eta * x, eta * y, eta - self.xi])
    }

    /// Angle in radians between the optical axis and the ray seen `rho_px` pixels from the principal
    /// point; `None` where [`unproject`](Self::unproject) has none.
    pub fn ray_angle(&self, rho_px: f64) -> Option<f64> {
        let r = rho_px / self.f;
        let eta = self.eta(r * r)?;
        Some(libm::atan2(eta * r, eta - self.xi))
    }

    /// The focal length in pixels at which a ray at angle `theta` radians, 0 < θ < π, appears `rho_px`
    /// pixels from the principal point of a camera of distortion `xi`: the inverse of
    /// [`ray_angle`](Self::ray_angle).
    pub fn focal_from(rho_px: f64, theta: f64, xi: f64) -> f64 {
        rho_px * (xi + libm::cos(theta)) / libm::sin(theta)
    }

    /// Horizontal field of view in degrees of a centred image of `width` pixels; `None` where its edge
    /// sees nothing.
    pub fn hfov_deg(&self, width: f64) -> Option<f64> {
        self.ray_angle(width / 2.0).map(|theta| 2.0 * theta.to_degrees())
    }

    /// Scale at the principal point, f/(1 + ξ), in pixels per radian.
    pub fn central_scale(&self) -> f64 {
        self.f / (1.0 + self.xi)
    }

    /// Whether every point of an image of `width` × `height` pixels sees a ray. The corners decide.
    pub fn whole_image_valid(&self, width: f64, height: f64) -> bool {
        [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)].iter().all(|&(u, v)| self.unproject(u, v).is_some())
    }

    /// Distance from the principal point, in pixels, from which on nothing is seen; infinite for ξ ≤ 1.
    pub fn largest_radius(&self) -> f64 {
        if self.xi > 1.0 { self.f / (self.xi * self.xi - 1.0).sqrt() } else { f64::INFINITY }
    }

    /// Cosine that a point's angle from the axis must exceed.
    fn lowest_cosine(&self) -> f64 {
        if self.xi > 1.0 { -1.0 / self.xi } else { -self.xi }
    }

    /// Length η of the ray from the projection centre to the sphere, per unit of (x̂, ŷ, 1).
    fn eta(&self, r2: f64) -> Option<f64> {
        let root = 1.0 + (1.0 - self.xi * self.xi) * r2;
        (root >= 0.0).then(|| (self.xi + root.sqrt()) / (1.0 + r2))
    }
}
