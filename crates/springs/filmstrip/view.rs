//! The view of a filmstrip: where a point of the scene is in a panel.

use super::Panel;
use super::drawing::{HEIGHT, WIDTH};
use nalgebra::{Matrix3, Vector3};
use springs_scene::Scene;

/// An orthographic projection.
pub(super) struct View {
    pub(super) right: Vector3<f64>,
    pub(super) up: Vector3<f64>,
    pub(super) toward: Vector3<f64>,
    /// Projected centre of all nodes, in m.
    centre: [f64; 2],
    /// Pixels per m, horizontally and vertically.
    pub(super) scale: [f64; 2],
}

impl View {
    pub(super) fn of(scene: &Scene, panels: &[Panel]) -> Self {
        let points = || panels.iter().flat_map(|panel| &panel.positions);
        let [right, up, toward] = axes(&scene.gravity, points);
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for point in points() {
            for (axis, value) in [right.dot(point), up.dot(point)].into_iter().enumerate() {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        let size = [0, 1].map(|axis| (high[axis] - low[axis]).max(0.0));
        let fit = |size: f64, pixels: f64| {
            if size > 0.0 {
                0.9 * pixels / size
            } else {
                f64::INFINITY
            }
        };
        let (across, along) = (fit(size[0], WIDTH), fit(size[1], HEIGHT));
        let scale = match across.min(along) {
            same if same.is_finite() => same,
            _ => 1.0,
        };
        Self {
            right,
            up,
            toward,
            centre: [0, 1].map(|axis| {
                if panels.is_empty() || scene.nodes.is_empty() {
                    0.0
                } else {
                    0.5 * (low[axis] + high[axis])
                }
            }),
            scale: [scale, scale * exaggeration(size, along / scale)],
        }
    }

    pub(super) fn vertical_exaggeration(&self) -> f64 {
        self.scale[1] / self.scale[0]
    }

    /// Pixels from the panel's upper left corner.
    pub(super) fn project(&self, point: &Vector3<f64>) -> [f64; 2] {
        let x = (self.right.dot(point) - self.centre[0]) * self.scale[0];
        let y = (self.up.dot(point) - self.centre[1]) * self.scale[1];
        [0.5 * WIDTH + x, 0.5 * HEIGHT - y]
    }
}

/// How much heights are stretched so that a long flat scene shows its shape: a
/// round number that fits the panel, 1 if the scene is not flat.
fn exaggeration(size: [f64; 2], room: f64) -> f64 {
    if size[1] == 0.0 || size[0] < 4.0 * size[1] {
        return 1.0;
    }
    let steps = [100.0, 50.0, 20.0, 10.0, 5.0, 2.0];
    let fitting = steps.into_iter().find(|&factor| factor <= 0.7 * room);
    fitting.unwrap_or(1.0)
}

/// Against gravity; along z where there is none.
pub(crate) fn up_of(gravity: &Vector3<f64>) -> Vector3<f64> {
    (-gravity).try_normalize(0.0).unwrap_or(Vector3::z())
}

/// Right, up and toward the viewer.
pub(crate) fn axes<'a, I>(gravity: &Vector3<f64>, points: impl Fn() -> I) -> [Vector3<f64>; 3]
where
    I: Iterator<Item = &'a Vector3<f64>>,
{
    let up = up_of(gravity);
    let n = points().count().max(1) as f64;
    let mean = points().sum::<Vector3<f64>>() / n;
    let spread: Matrix3<f64> = points()
        .map(|point| (point - mean) * (point - mean).transpose())
        .sum::<Matrix3<f64>>()
        / n;
    let eigen = spread.symmetric_eigen();
    let smallest = eigen.eigenvalues.imin();
    let flat = eigen.eigenvalues[smallest] <= 1e-4 * eigen.eigenvalues.max();
    let normal = eigen.eigenvectors.column(smallest).into_owned();
    let across = normal - up * normal.dot(&up);
    let toward = if flat && across.norm() > 0.5 {
        // Seen from the front: the side that looks along −y or −x.
        let sign = if across.x - across.y < 0.0 { -1.0 } else { 1.0 };
        across.normalize() * sign
    } else {
        // Slanted from above, between the two horizontal axes.
        let first = [Vector3::x(), Vector3::y(), Vector3::z()]
            .into_iter()
            .find(|axis| axis.dot(&up).abs() < 0.7)
            .unwrap_or(Vector3::x());
        let first = (first - up * first.dot(&up)).normalize();
        let second = up.cross(&first);
        let (azimuth, elevation) = (-60f64.to_radians(), 22f64.to_radians());
        let level = first * azimuth.cos() + second * azimuth.sin();
        level * elevation.cos() + up * elevation.sin()
    };
    let right = up.cross(&toward).normalize();
    [right, toward.cross(&right), toward]
}
