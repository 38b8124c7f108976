//! The linearly implicit step against a dense twin that shares no code with it:
//! full matrices over all nodes, Eq. 8 as printed, tangents by eigenvalues,
//! prescribed nodes by partition, LU instead of Cholesky.

mod common;

use common::{distance, largest, tangle, with};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use springs_scene::generate::{Material, block, chain, cloth, disturb};
use springs_scene::{Method, Scene, Tangent};
use springs_step::{NodeStates, Stepper};

struct Twin<'a> {
    scene: &'a Scene,
    tangent: Tangent,
    tensions: Vec<f64>,
    /// Springs clamped on demand so far.
    clamped: u64,
}

impl<'a> Twin<'a> {
    fn new(scene: &'a Scene, tangent: Tangent) -> Self {
        let tension = |spring: &springs_scene::Spring| {
            let [a, b] = spring.nodes.map(|node| scene.nodes[node].position);
            spring.stiffness * ((b - a).norm() - spring.rest_length)
        };
        Self {
            scene,
            tangent,
            tensions: scene.springs.iter().map(tension).collect(),
            clamped: 0,
        }
    }

    /// One spring's share of the Hessian.
    fn block(&self, index: usize, dx: Vector3<f64>, clamp: bool) -> Matrix3<f64> {
        let spring = &self.scene.springs[index];
        let (k, l, l0) = (spring.stiffness, dx.norm(), spring.rest_length);
        let outer = dx * dx.transpose();
        let identity = Matrix3::identity() * dx.dot(&dx);
        // Eq. 8 of the note.
        let exact = (outer + (identity - outer) * ((l - l0) / l)) * (k / (l * l));
        let block = match self.tangent {
            Tangent::Material => outer * (k / (l * l)),
            Tangent::Filtered => {
                let across = (identity - outer) / (l * l);
                outer * (k / (l * l)) + across * (self.tensions[index] / l)
            }
            _ => exact,
        };
        let eigen = |change: fn(f64) -> f64| {
            let mut eigen = block.symmetric_eigen();
            eigen.eigenvalues.apply(|value| *value = change(*value));
            eigen.recompose()
        };
        match self.tangent {
            Tangent::Absolute => eigen(f64::abs),
            Tangent::Clamped => eigen(|value| value.max(0.0)),
            _ if clamp => eigen(|value| value.max(0.0)),
            _ => block,
        }
    }

    /// Full M, D, H and f over all nodes.
    fn assemble(&self, nodes: &NodeStates, clamp: bool) -> [DMatrix<f64>; 4] {
        let n = 3 * nodes.positions.len();
        let (mut m, mut d, mut h) = (
            DMatrix::zeros(n, n),
            DMatrix::zeros(n, n),
            DMatrix::zeros(n, n),
        );
        let mut f = DMatrix::zeros(n, 1);
        for (node, mass) in self.scene.node_masses().into_iter().enumerate() {
            for axis in 0..3 {
                m[(3 * node + axis, 3 * node + axis)] = mass;
                f[3 * node + axis] += mass * self.scene.gravity[axis];
            }
        }
        for (index, spring) in self.scene.springs.iter().enumerate() {
            let [a, b] = spring.nodes;
            let dx = nodes.positions[b] - nodes.positions[a];
            let force = dx * (spring.stiffness * (dx.norm() - spring.rest_length) / dx.norm());
            let stiffness = self.block(index, dx, clamp);
            let damping = dx * dx.transpose() * (spring.damping / dx.norm_squared());
            for axis in 0..3 {
                f[3 * a + axis] += force[axis];
                f[3 * b + axis] -= force[axis];
            }
            for (row, column, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                let mut view = h.fixed_view_mut::<3, 3>(3 * row, 3 * column);
                view += stiffness * sign;
                let mut view = d.fixed_view_mut::<3, 3>(3 * row, 3 * column);
                view += damping * sign;
            }
        }
        [m, d, h, f]
    }

    /// Springs with a free end and a negative tension.
    fn count_compressed(&self, nodes: &NodeStates) -> u64 {
        let compressed = |(index, spring): (usize, &springs_scene::Spring)| {
            let [a, b] = spring.nodes;
            let length = (nodes.positions[b] - nodes.positions[a]).norm();
            let negative = match self.tangent {
                Tangent::Filtered => self.tensions[index] < 0.0,
                _ => length < spring.rest_length,
            };
            let free = !self.scene.nodes[a].fixed || !self.scene.nodes[b].fixed;
            u64::from(negative && free)
        };
        self.scene.springs.iter().enumerate().map(compressed).sum()
    }

    fn step(&mut self, nodes: &mut NodeStates, h: f64) {
        let mut rows = Vec::new();
        let mut prescribed = Vec::new();
        for (node, kind) in self.scene.nodes.iter().enumerate() {
            let target = if kind.fixed {
                &mut prescribed
            } else {
                &mut rows
            };
            target.extend(3 * node..3 * node + 3);
        }
        let v = DVector::from_iterator(
            3 * nodes.velocities.len(),
            nodes.velocities.iter().flatten().copied(),
        );
        let may_clamp = matches!(self.tangent, Tangent::Exact | Tangent::Filtered);
        let mut solution = None;
        for clamp in [false, true] {
            let [mass, damping, hessian, f] = self.assemble(nodes, clamp);
            let a = &mass + damping * h + hessian * (h * h);
            let free = a.select_rows(&rows).select_columns(&rows);
            if !clamp && may_clamp && free.clone().cholesky().is_none() {
                self.clamped += self.count_compressed(nodes);
                continue;
            }
            let known =
                a.select_rows(&rows).select_columns(&prescribed) * v.select_rows(&prescribed);
            let rhs = (&mass * &v + f.column(0) * h).select_rows(&rows) - known;
            solution = Some(free.lu().solve(&rhs).expect("a regular matrix"));
            break;
        }
        let mut new = v;
        for (row, value) in rows.iter().zip(solution.expect("a step").iter()) {
            new[*row] = *value;
        }
        for (velocity, new) in nodes.velocities.iter_mut().zip(new.as_slice().chunks(3)) {
            *velocity = Vector3::from_column_slice(new);
        }
        for (tension, spring) in self.tensions.iter_mut().zip(&self.scene.springs) {
            let [a, b] = spring.nodes;
            let dx = nodes.positions[b] - nodes.positions[a];
            let approach = dx
                .normalize()
                .dot(&(nodes.velocities[b] - nodes.velocities[a]));
            *tension = spring.stiffness * (dx.norm() - spring.rest_length + h * approach);
        }
        for (position, velocity) in nodes.positions.iter_mut().zip(&nodes.velocities) {
            *position += velocity * h;
        }
    }
}

fn compare(scene: &Scene, h: f64) -> u64 {
    let mut clamped = 0;
    for &tangent in Tangent::ALL {
        let scene = with(scene, Method::LinearlyImplicitEuler, Some(tangent), h);
        let mut twin = Twin::new(&scene, tangent);
        let mut expected = NodeStates::of(&scene);
        let mut nodes = expected.clone();
        let mut stepper = Stepper::new(&scene).unwrap();
        let mut counted = 0;
        for step in 1..=10 {
            twin.step(&mut expected, h);
            counted += stepper.step(&mut nodes, h).unwrap().counts.clamped_springs;
            assert_eq!(
                counted, twin.clamped,
                "{}, {tangent}, step {step}",
                scene.name
            );
            let x = distance(&nodes.positions, &expected.positions) / largest(&expected.positions);
            let v =
                distance(&nodes.velocities, &expected.velocities) / largest(&expected.velocities);
            assert!(
                x < 1e-10 && v < 1e-10,
                "{}, {tangent}, step {step}: positions {x:e}, velocities {v:e}",
                scene.name
            );
        }
        clamped += twin.clamped;
    }
    clamped
}

#[test]
fn chain_agrees() {
    let mut scene = chain(12, Material::of_chain(12));
    disturb(&mut scene, 1e-2, 1);
    compare(&scene, 1.0 / 60.0);
}

#[test]
fn cloth_agrees() {
    let mut scene = cloth(6, Material::of_cloth());
    disturb(&mut scene, 1e-2, 2);
    compare(&scene, 1.0 / 60.0);
}

#[test]
fn block_agrees() {
    let mut scene = block(4, Material::of_block());
    scene.gravity = Vector3::new(20.0, 3.0, -5.0);
    compare(&scene, 1.0 / 60.0);
}

#[test]
fn tangles_agree_also_where_they_are_clamped() {
    let mut clamped = 0;
    for seed in 0..6 {
        clamped += compare(&tangle(25, seed), 0.02);
        clamped += compare(&tangle(25, seed), 0.1);
    }
    assert!(clamped > 0, "the scenes must reach the clamped branch");
}
