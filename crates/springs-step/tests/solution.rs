//! Systems solved by iteration: as well as directly where that was asked for,
//! and well enough for the method where not.

use springs_assembly::{Evaluation, OffDiagonal, Projection, Weights, compile};
use springs_scene::generate::{Material, block, cloth};
use springs_scene::{LinearTolerance, Method, Node, RunOptions, Scene, StepControl, Vector3};
use springs_solver::{Options, Solver};
use springs_step::{Counts, Simulation};

/// Positions after half a second, and what it took.
fn run(
    scene: &Scene,
    method: Method,
    step: f64,
    linear_tolerance: LinearTolerance,
) -> (Vec<Vector3<f64>>, Counts) {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.step = StepControl::Fixed(step);
    scene.settings.duration = 0.5;
    let options = RunOptions::default().with_linear_tolerance(linear_tolerance);
    let mut simulation = Simulation::with_options(&scene, &options).unwrap();
    simulation.run(1, &mut ()).unwrap();
    (
        simulation.nodes().positions.clone(),
        simulation.work().counts,
    )
}

fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let distances = a.iter().zip(b).map(|(a, b)| (a - b).norm());
    distances.fold(0.0, f64::max)
}

/// Half a second of linearly implicit Euler with a fresh factor in double
/// precision at every step.
fn factorized_at_every_step(scene: &Scene) -> Vec<Vector3<f64>> {
    let system = compile(scene).unwrap();
    let n_free = system.n_free();
    let mut solver = Solver::analyze(n_free, system.pattern().pairs(), Options::default()).unwrap();
    let mut x = system.initial_positions().to_vec();
    let mut v = system.initial_velocities().to_vec();
    let mut out = system.linearization();
    for _ in 0..30 {
        for projection in [Projection::None, Projection::Clamp] {
            let at = Evaluation {
                projection,
                ..Evaluation::new(&x, &v, Weights::of_step(H))
            };
            system.linearize(&at, &mut out);
            let matrix = &out.matrix;
            let OffDiagonal::Symmetric(pairs) = matrix.off_diagonal() else {
                panic!("springs have symmetric blocks");
            };
            let done = solver.set_matrix(matrix.diagonal(), pairs);
            if done.is_ok() {
                break;
            }
        }
        let momenta = system.masses().iter().zip(&v).zip(&out.forces);
        let rhs = momenta.flat_map(|((m, v), f)| <[f64; 3]>::from(v * *m + f * H));
        let mut new: Vec<f64> = rhs.collect();
        solver.solve_in_place(&mut new, 1e-11).unwrap();
        for ((x, v), new) in x.iter_mut().zip(&mut v).zip(new.as_chunks::<3>().0) {
            *v = Vector3::from(*new);
            *x += *v * H;
        }
    }
    let mut nodes = vec![Vector3::zeros(); scene.nodes.len()];
    system.numbering().scatter(&x, &mut nodes);
    nodes
}

const H: f64 = 1.0 / 60.0;

/// Large enough for iteration without a factor.
fn scenes() -> [Scene; 2] {
    [
        cloth(64, Material::of_cloth()),
        block(12, Material::of_block()),
    ]
}

#[test]
fn strict_solutions_are_those_of_a_fresh_factor() {
    for scene in &scenes() {
        let method = Method::LinearlyImplicitEuler;
        let (strict, _) = run(scene, method, H, LinearTolerance::Strict);
        let difference = distance(&strict, &factorized_at_every_step(scene));
        assert!(difference < 1e-8, "{}: {difference:e}", scene.name);
    }
}

#[test]
fn sufficient_solutions_change_the_error_by_less_than_a_hundredth() {
    for scene in scenes() {
        let method = Method::LinearlyImplicitEuler;
        let (fine, _) = run(&scene, method, H / 8.0, LinearTolerance::Sufficient);
        let (strict, _) = run(&scene, method, H, LinearTolerance::Strict);
        let (sufficient, counts) = run(&scene, method, H, LinearTolerance::Sufficient);
        let (of_strict, of_sufficient) = (distance(&strict, &fine), distance(&sufficient, &fine));
        let change = (of_sufficient / of_strict - 1.0).abs();
        assert!(change < 0.01, "{}: {change:e}", scene.name);
        assert!(counts.solver_iterations > 0, "{} iterates", scene.name);
        assert_eq!(counts.factorizations, 0, "{} has no factor", scene.name);
    }
}

/// Newton's method corrects what a loose solution of its systems leaves.
#[test]
fn converged_methods_do_not_depend_on_how_systems_are_solved() {
    let [_, block] = scenes();
    for method in [Method::ImplicitEuler, Method::TrBdf2] {
        let (strict, _) = run(&block, method, H, LinearTolerance::Strict);
        let (sufficient, counts) = run(&block, method, H, LinearTolerance::Sufficient);
        let difference = distance(&strict, &sufficient);
        assert!(difference < 1e-9, "{method}: {difference:e}");
        assert!(counts.solver_iterations > 0);
    }
}

/// Free flight: no solution, however loose, makes momentum.
#[test]
fn iteration_makes_no_momentum() {
    let mut scene = block(12, Material::of_block());
    scene.gravity = Vector3::zeros();
    for (index, node) in scene.nodes.iter_mut().enumerate() {
        node.fixed = false;
        node.velocity = Vector3::new((index as f64).sin(), 1.0, (0.3 * index as f64).cos());
    }
    let masses = scene.node_masses();
    let momentum = |velocities: &[Vector3<f64>]| -> Vector3<f64> {
        velocities.iter().zip(&masses).map(|(v, m)| v * *m).sum()
    };
    scene.settings.method = Method::LinearlyImplicitEuler;
    scene.settings.step = StepControl::Fixed(H);
    let mut simulation = Simulation::new(&scene).unwrap();
    let before = momentum(&simulation.nodes().velocities);
    simulation.run(1, &mut ()).unwrap();
    assert!(simulation.work().counts.solver_iterations > 0);
    let after = momentum(&simulation.nodes().velocities);
    let relative = (after - before).norm() / before.norm();
    assert!(relative < 1e-12, "{relative:e}");
}

/// What all nodes have in common does not count for the accuracy of a solution:
/// the motion within is the same at any speed of the whole.
#[test]
fn moving_frames_change_nothing() {
    let held = block(12, Material::of_block());
    let mut free = held.clone();
    free.nodes.iter_mut().for_each(|node| node.fixed = false);
    for (index, node) in free.nodes.iter_mut().enumerate() {
        node.position *= 1.0 + 0.1 * (index as f64).sin();
    }
    for scene in [held, free] {
        for solution in [LinearTolerance::Sufficient, LinearTolerance::Strict] {
            let moved = |speed: f64| {
                let mut scene = scene.clone();
                let velocity = Vector3::new(0.6, 0.0, 0.8) * speed;
                for node in &mut scene.nodes {
                    node.velocity += velocity;
                }
                let method = Method::LinearlyImplicitEuler;
                let (positions, counts) = run(&scene, method, H, solution);
                assert!(counts.solver_iterations > 0);
                let back = positions.iter().map(|x| x - velocity * 0.5);
                back.collect::<Vec<_>>()
            };
            let at_rest = moved(0.0);
            for speed in [100.0, 1e4] {
                let difference = distance(&at_rest, &moved(speed));
                assert!(
                    difference < 1e-7,
                    "{solution:?}, {speed} m/s: {difference:e}"
                );
            }
        }
    }
}

/// A matrix of zero rest lengths does not depend on the state; with steps of
/// changing size it changes all the same, and iteration is cheaper than factors.
#[test]
fn constant_matrices_are_iterated_with_where_steps_change() {
    let mut scene = block(24, Material::of_block());
    for spring in &mut scene.springs {
        spring.rest_length = 0.0;
    }
    scene.settings.method = Method::TrBdf2;
    scene.settings.duration = 1e-3;
    for (step, iterates) in [
        (StepControl::Fixed(1e-3), false),
        (StepControl::Tolerance(1e-3), true),
    ] {
        scene.settings.step = step;
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.run(1, &mut ()).unwrap();
        let counts = simulation.work().counts;
        assert_eq!(counts.solver_iterations > 0, iterates, "{step:?}");
        assert_eq!(counts.factorizations == 0, iterates, "{step:?}");
    }
}

/// A massless node hides no mass, and does not keep others from being refined.
#[test]
fn stiff_solutions_are_refined_beside_a_massless_node() {
    let mut scene = Scene {
        gravity: Vector3::new(0.0, 0.0, -9.81),
        ..Scene::default()
    };
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node::at(Vector3::new(0.5, 0.0, -0.5)));
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::new(1.0, 0.0, -1.0))
    });
    for ends in [[0, 1], [1, 2]] {
        let spring = scene.add_spring(ends[0], ends[1], 1e12);
        scene.springs[spring].rest_length *= 1.0 - 1e-9;
    }
    let (_, counts) = run(
        &scene,
        Method::LinearlyImplicitEuler,
        0.01,
        LinearTolerance::Strict,
    );
    assert_eq!(2 * counts.refinements, counts.solves);
}
