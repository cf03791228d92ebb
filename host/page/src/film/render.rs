//! Draws solids by their intersections with the rays of a camera.

use nalgebra::Vector3;
use study::draw;

pub(super) type V3 = Vector3<f64>;

/// Red, green and blue, 0 to 1.
pub(super) type Rgb = [f32; 3];

pub(super) const BACKGROUND: Rgb = [0.98, 0.98, 0.97];
pub(super) const FLAGELLA: [Rgb; 2] = [single(draw::FLAGELLA[0]), single(draw::FLAGELLA[1])];
pub(super) const BASE: Rgb = single(draw::BASE);
pub(super) const DIAL: Rgb = [0.7, 0.72, 0.75];
pub(super) const CHART: Rgb = [0.2, 0.2, 0.22];

const fn single([red, green, blue]: [f64; 3]) -> Rgb {
    [red as f32, green as f32, blue as f32]
}

/// Samples of a pixel along each side.
const SAMPLES: usize = 2;

/// A solid between two points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solid {
    pub from: V3,
    pub to: V3,
    pub radius: f64,
    /// Round ends, or flat ones.
    pub is_round: bool,
    pub colour: Rgb,
    /// Whether light and shade show on it.
    pub is_lit: bool,
}

impl Solid {
    /// A rod with round ends.
    pub(super) fn rod(from: V3, to: V3, radius: f64, colour: Rgb) -> Self {
        Self { from, to, radius, is_round: true, colour, is_lit: true }
    }

    /// A cylinder.
    pub(super) fn cylinder(from: V3, to: V3, radius: f64, colour: Rgb) -> Self {
        Self { is_round: false, ..Self::rod(from, to, radius, colour) }
    }

    /// Returns the distance along a ray from `eye` in the unit direction `ray`, and the normal of the surface there.
    fn hit(&self, eye: V3, ray: V3) -> Option<(f64, V3)> {
        let (axis, from) = (self.to - self.from, eye - self.from);
        let (aa, ar, af) = (axis.dot(&axis), axis.dot(&ray), axis.dot(&from));
        let a = aa - ar * ar;
        let b = aa * ray.dot(&from) - af * ar;
        let c = aa * from.dot(&from) - af * af - self.radius * self.radius * aa;
        // A ray along the axis meets no side.
        let is_axial = a <= 1e-12 * aa;
        let under = b * b - a * c;
        if under < 0.0 || is_axial && c > 0.0 {
            return None;
        }
        let along = match is_axial {
            true if ar > 0.0 => -1.0,
            true => 2.0 * aa,
            false => {
                let t = (-b - under.sqrt()) / a;
                let along = af + t * ar;
                if (0.0..=aa).contains(&along) {
                    return Some((t, (from + ray * t - axis * (along / aa)) / self.radius));
                }
                along
            }
        };
        if self.is_round {
            let centre = if along < 0.0 { self.from } else { self.to };
            let from = eye - centre;
            let (b, c) = (ray.dot(&from), from.dot(&from) - self.radius * self.radius);
            let under = b * b - c;
            let t = -b - under.max(0.0).sqrt();
            return (under > 0.0).then(|| (t, (from + ray * t) / self.radius));
        }
        let t = (if along < 0.0 { 0.0 } else { aa } - af) / ar;
        let normal = axis * (along.signum() / aa.sqrt());
        (is_axial || (b + a * t).abs() < under.sqrt()).then_some((t, normal))
    }
}

/// A camera that looks at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    eye: V3,
    forward: V3,
    right: V3,
    up: V3,
    /// Pixels for a unit of the tangent of the angle of view.
    scale: f64,
    size: [usize; 2],
}

impl Camera {
    /// A camera at `eye` that looks at `target` and shows `height` there, from the lower to the upper edge.
    pub(super) fn new(eye: V3, target: V3, height: f64, size: [usize; 2]) -> Self {
        let forward = (target - eye).normalize();
        let right = forward.cross(&V3::z()).normalize();
        let up = right.cross(&forward);
        Self { eye, forward, right, up, scale: size[1] as f64 * (target - eye).norm() / height, size }
    }

    /// Returns the ray through a point of the image.
    fn ray(&self, x: f64, y: f64) -> V3 {
        let [width, height] = self.size.map(|pixels| pixels as f64);
        let (right, up) = ((x - 0.5 * width) / self.scale, (0.5 * height - y) / self.scale);
        (self.forward + self.right * right + self.up * up).normalize()
    }

    /// Returns the position of a point on the image, pixels, its distance along the view, m, and the pixels per metre there.
    pub(super) fn project(&self, point: V3) -> ([f64; 2], f64, f64) {
        let from = point - self.eye;
        let depth = from.dot(&self.forward);
        let scale = self.scale / depth;
        let [width, height] = self.size.map(|pixels| pixels as f64);
        ([0.5 * width + from.dot(&self.right) * scale, 0.5 * height - from.dot(&self.up) * scale], depth, scale)
    }

    /// Returns the pixels, first and last of each axis, in which a solid may be seen.
    fn bounds(&self, solid: &Solid) -> Option<[[usize; 2]; 2]> {
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for point in [solid.from, solid.to] {
            let (centre, depth, _) = self.project(point);
            if depth <= solid.radius {
                return None;
            }
            // A sphere off the middle is seen as an ellipse, whose long half axis exceeds the sphere's radius.
            let reach = 1.3 * solid.radius * self.scale / (depth - solid.radius) + 1.0;
            for (bound, centre) in bounds.iter_mut().zip(centre) {
                *bound = [bound[0].min(centre - reach), bound[1].max(centre + reach)];
            }
        }
        let mut pixels = [[0; 2]; 2];
        for (k, [first, last]) in bounds.into_iter().enumerate() {
            if last < 0.0 || first >= self.size[k] as f64 {
                return None;
            }
            pixels[k] = [first.max(0.0) as usize, (last as usize).min(self.size[k] - 1)];
        }
        Some(pixels)
    }

    /// Draws solids.
    pub(super) fn draw(&self, solids: &[Solid]) -> Vec<Rgb> {
        let [width, height] = self.size;
        let mut nearest = vec![(f64::INFINITY, BACKGROUND); width * height * SAMPLES * SAMPLES];
        for solid in solids {
            let Some([[left, right], [top, bottom]]) = self.bounds(solid) else { continue };
            for (y, x) in (top..=bottom).flat_map(|y| (left..=right).map(move |x| (y, x))) {
                for sample in 0..SAMPLES * SAMPLES {
                    let within = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
                    let ray = self.ray(x as f64 + within(sample % SAMPLES), y as f64 + within(sample / SAMPLES));
                    let place = &mut nearest[(y * width + x) * SAMPLES * SAMPLES + sample];
                    if let Some((t, normal)) = solid.hit(self.eye, ray)
                        && t > 0.0
                        && t < place.0
                    {
                        *place = (t, if solid.is_lit { self.lit(solid.colour, normal) } else { solid.colour });
                    }
                }
            }
        }
        let mean = |samples: &[(f64, Rgb)]| -> Rgb {
            // A pixel with equal samples keeps its exact colour.
            if samples.iter().all(|(_, colour)| *colour == samples[0].1) {
                return samples[0].1;
            }
            std::array::from_fn(|k| samples.iter().map(|(_, colour)| colour[k]).sum::<f32>() / samples.len() as f32)
        };
        nearest.chunks_exact(SAMPLES * SAMPLES).map(mean).collect()
    }

    /// Returns a colour in the light from the upper left, with a soft fill from the camera.
    fn lit(&self, colour: Rgb, normal: V3) -> Rgb {
        let light = (self.up * 0.8 - self.right * 0.5 - self.forward * 0.6).normalize();
        let key = normal.dot(&light).max(0.0);
        let fill = normal.dot(&-self.forward).max(0.0);
        let shade = (0.35 + 0.6 * key + 0.25 * fill) as f32;
        colour.map(|part| (part * shade).min(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_hit_the_surfaces_of_solids() {
        let (from, to) = (V3::zeros(), V3::new(0.0, 0.0, 2.0));
        let rod = Solid::rod(from, to, 0.5, BASE);
        let cylinder = Solid { is_round: false, ..rod };
        let near = |hit: Option<(f64, V3)>, t: f64, normal: V3| {
            let (found_t, found) = hit.unwrap();
            assert!((found_t - t).abs() < 1e-12 && (found - normal).norm() < 1e-12, "{found_t} {found}");
        };
        for solid in [rod, cylinder] {
            near(solid.hit(V3::new(-3.0, 0.0, 1.0), V3::x()), 2.5, -V3::x());
            assert!(solid.hit(V3::new(-3.0, 0.6, 1.0), V3::x()).is_none());
        }
        near(rod.hit(V3::new(0.0, 0.0, 5.0), -V3::z()), 2.5, V3::z());
        near(cylinder.hit(V3::new(0.3, 0.0, 5.0), -V3::z()), 3.0, V3::z());
        near(cylinder.hit(V3::new(0.3, 0.0, -5.0), V3::z()), 5.0, -V3::z());
        near(cylinder.hit(V3::new(-0.5, 0.0, 3.0), V3::new(0.6, 0.0, -0.8)), 1.25, V3::z());
        assert!(cylinder.hit(V3::new(0.6, 0.0, 5.0), -V3::z()).is_none());
        assert!(rod.hit(V3::new(-3.0, 0.0, 2.6), V3::x()).is_none(), "above the round end");
    }

    /// The projection of a sphere is found by its rays where the camera expects it, also near a corner.
    #[test]
    fn bounds_hold_all_of_a_solid() {
        let size = [60, 40];
        let camera = Camera::new(V3::new(3.0, -4.0, 2.0), V3::new(0.0, 0.0, -0.3), 2.0, size);
        for (x, z) in [(0.0, 0.0), (0.7, 0.4), (-0.9, -0.8), (1.1, 0.3)] {
            let solid = Solid::rod(V3::new(x, 0.2, z), V3::new(x + 0.1, 0.3, z - 0.2), 0.15, BASE);
            let [[left, right], [top, bottom]] = camera.bounds(&solid).unwrap();
            for (px, py) in (0..size[0]).flat_map(|px| (0..size[1]).map(move |py| (px, py))) {
                let is_hit = solid.hit(camera.eye, camera.ray(px as f64 + 0.5, py as f64 + 0.5)).is_some();
                let is_inside = (left..=right).contains(&px) && (top..=bottom).contains(&py);
                assert!(is_inside || !is_hit, "{px}, {py} is outside {left}..{right}, {top}..{bottom}");
            }
        }
    }
}
