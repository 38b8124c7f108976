//! Springs with laws.

use super::Random;
use springs_scene::{Scene, SpringLaw};

/// Each law beside the linear one, with `axial` N of stiffness in strain at rest or
/// beyond the blend.
pub fn laws(axial: f64) -> Vec<SpringLaw> {
    let blend = 0.2;
    let points = [
        [-0.4, -0.6],
        [-0.1, -0.08],
        [0.0, 0.0],
        [0.1, 0.1],
        [0.4, 0.7],
    ];
    vec![
        SpringLaw::TensionOnly { blend },
        SpringLaw::CompressionOnly { blend },
        SpringLaw::Bilinear {
            compression: 0.2 * axial,
            blend,
        },
        SpringLaw::Limit {
            strain: 0.1,
            stiffness: 2.0 * axial,
            blend,
        },
        SpringLaw::Power { exponent: 1.5 },
        SpringLaw::Polynomial([axial, -0.2 * axial, 2.0 * axial].into()),
        SpringLaw::Table(points.map(|[e, t]| [e, t * axial]).into()),
    ]
}

/// The scene with a law, or none, for each spring.
pub fn with_laws(mut scene: Scene, axial: f64, of: impl Fn(usize) -> Option<usize>) -> Scene {
    scene.laws = laws(axial);
    for (index, spring) in scene.springs.iter_mut().enumerate() {
        spring.law = of(index);
        let own = spring
            .law
            .and_then(|law| scene.laws[law].own_axial_stiffness());
        if let Some(own) = own {
            spring.stiffness = own / spring.rest_length;
        }
    }
    scene.name += " with laws";
    scene
}

/// All laws, and the linear one, in a random order.
pub fn with_mixed_laws(scene: Scene, seed: u64) -> Scene {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let laws: Vec<Option<usize>> = scene
        .springs
        .iter()
        .map(|_| Some(random.below(8)).filter(|&law| law < 7))
        .collect();
    with_laws(scene, 50.0, |spring| laws[spring])
}
