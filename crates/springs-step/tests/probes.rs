//! Probes: what they tell, when, and that nothing else depends on them.

mod common;

use common::{METHODS, append, tangle, with};
use springs_scene::{
    Node, Probe, ProbeQuantity, Probed, RunOptions, Scene, Spring, SpringLaw, StepControl, Vector3,
};
use springs_step::{Frame, Islands, Observer, Outcome, Peak, Samples, properties};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// Everything that was seen, and where to stop.
#[derive(Default)]
struct Look {
    samples: Vec<(f64, usize, Vec<f64>)>,
    frames: Vec<(f64, Vec<f64>)>,
    stop_after: Option<usize>,
}

impl Observer for Look {
    fn wants_members(&self) -> bool {
        true
    }

    fn wants_samples(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        let tensions = frame.members.unwrap().tensions.clone();
        self.frames.push((frame.time, tensions));
        ControlFlow::Continue(())
    }

    fn samples(&mut self, samples: Samples<'_>) -> ControlFlow<()> {
        for sample in samples.samples {
            let seen = (samples.time, sample.probe, sample.values.clone());
            self.samples.push(seen);
        }
        if self.stop_after == Some(self.samples.len()) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

fn probe(on: Probed, of: &[ProbeQuantity], every: Option<f64>) -> Probe {
    Probe {
        on,
        of: of.to_vec(),
        every,
    }
}

/// A weight that swings along a spring: x = 1 + a sin(ωt).
fn swinging() -> (Scene, f64, f64) {
    let (stiffness, mass, amplitude): (f64, f64, f64) = (50.0, 0.5, 0.1);
    let omega = (stiffness / mass).sqrt();
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass,
        velocity: Vector3::x() * (amplitude * omega),
        ..Node::at(Vector3::x())
    });
    scene.add_spring(0, 1, stiffness);
    scene.settings.duration = 2.0 * TAU / omega;
    (scene, omega, amplitude)
}

/// Between the ends of long steps, too.
#[test]
fn what_they_tell_is_the_motion_to_the_order_of_the_method() {
    use ProbeQuantity::{Energy, Length, Position, Strain, Tension, Velocity};
    let (mut scene, omega, amplitude) = swinging();
    scene.output.probes = vec![
        probe(
            Probed::Nodes(vec![1]),
            &[Position, Velocity, Energy],
            Some(scene.settings.duration / 200.0),
        ),
        probe(
            Probed::Springs(vec![0]),
            &[Length, Strain, Tension, Energy],
            None,
        ),
    ];
    for method in METHODS {
        let off_with = |steps: f64| {
            let scene = with(&scene, method, None, scene.settings.duration / steps);
            let mut look = Look::default();
            Islands::new(&scene).unwrap().run(70, &mut look).unwrap();
            let mut off = 0.0_f64;
            let mut times = [Vec::new(), Vec::new()];
            for (time, probe, values) in &look.samples {
                times[*probe].push(*time);
                let (swing, speed) = (amplitude * (omega * time).sin(), (omega * time).cos());
                let speed = amplitude * omega * speed;
                let expected = match probe {
                    0 => vec![1.0 + swing, 0.0, 0.0, speed, 0.0, 0.0, 0.25 * speed * speed],
                    _ => vec![1.0 + swing, swing, 50.0 * swing, 25.0 * swing * swing],
                };
                assert_eq!(values.len(), expected.len());
                for (value, expected) in values.iter().zip(expected) {
                    off = off.max((value - expected).abs());
                }
            }
            let duration = scene.settings.duration;
            let every = scene.output.probes[0].every.unwrap();
            let mut own: Vec<f64> = (0..200).map(|k| every * f64::from(k)).collect();
            own.push(duration);
            let frames = (0..=70).map(|k| duration * f64::from(k) / 70.0);
            assert_eq!(times, [own, frames.collect()], "{method}");
            off
        };
        let order = properties(method).unwrap().order.min(6);
        let (coarse, fine) = (off_with(96.0), off_with(192.0));
        let found = (coarse / fine).log2();
        assert!(
            found > f64::from(order) - 0.35 || fine < 1e-10,
            "{method}: {found}, {coarse}, {fine}"
        );
    }
}

/// Two parts of several springs, some of which are one to the system, with laws.
fn parts() -> Scene {
    let mut scene = tangle(9, 3);
    append(&mut scene, &tangle(7, 4));
    scene.laws = vec![SpringLaw::TensionOnly { blend: 1e-3 }];
    scene.springs[2].law = Some(0);
    let twin = scene.springs[5];
    scene.springs.push(Spring {
        stiffness: 3.0 * twin.stiffness,
        ..twin
    });
    scene.settings.duration = 0.4;
    scene.output.probes = vec![
        probe(
            Probed::Springs((0..scene.springs.len()).collect()),
            &[ProbeQuantity::Tension, ProbeQuantity::Energy],
            Some(0.013),
        ),
        probe(
            Probed::Nodes(vec![3, 12]),
            &ProbeQuantity::ALL[..2],
            Some(0.01),
        ),
        probe(Probed::Nodes(vec![5]), &[ProbeQuantity::Energy], None),
    ];
    scene
}

fn run(scene: &Scene, options: &RunOptions) -> (Look, Islands) {
    let mut look = Look::default();
    let mut islands = Islands::with_options(scene, options).unwrap();
    islands.run(9, &mut look).unwrap();
    (look, islands)
}

#[test]
fn steps_do_not_depend_on_them_nor_they_on_threads_and_stops() {
    for step in [StepControl::Auto, StepControl::Fixed(0.03)] {
        let mut scene = parts();
        scene.settings.step = step;
        let (whole, islands) = run(&scene, &RunOptions::default().with_threads(1));
        assert!(islands.parts().len() > 1);
        let mut blind = scene.clone();
        blind.output.probes.clear();
        let (_, unseen) = run(&blind, &RunOptions::default());
        assert_eq!(islands.nodes(), unseen.nodes());
        assert_eq!(islands.work().counts, unseen.work().counts);
        let (threads, _) = run(&scene, &RunOptions::default().with_threads(8));
        assert_eq!(whole.samples, threads.samples);

        let mut look = Look::default();
        let mut islands = Islands::new(&scene).unwrap();
        for stop in (1..whole.samples.len()).step_by(3) {
            look.stop_after = Some(stop);
            let outcome = islands.run(9, &mut look).unwrap();
            assert!(outcome == Outcome::Stopped || look.samples.len() == whole.samples.len());
            let words = islands.save();
            islands = Islands::new(&scene).unwrap();
            islands.restore(words).unwrap();
        }
        look.stop_after = None;
        islands.run(9, &mut look).unwrap();
        assert_eq!(look.samples, whole.samples);
    }
}

/// In one part as in several, and of a spring that is one with another as of both.
#[test]
fn parts_tell_what_the_whole_tells() {
    let mut scene = parts();
    scene.settings.method = springs_scene::Method::Dop853;
    scene.settings.step = StepControl::Fixed(0.004);
    let (in_parts, _) = run(&scene, &RunOptions::default());
    let (whole, islands) = run(&scene, &RunOptions::default().with_skip(false));
    assert_eq!(islands.parts().len(), 1);
    assert_eq!(in_parts.samples.len(), whole.samples.len());
    for (a, b) in in_parts.samples.iter().zip(&whole.samples) {
        assert_eq!((a.0, a.1), (b.0, b.1));
        for (a, b) in a.2.iter().zip(&b.2) {
            assert!((a - b).abs() < 1e-6 * (1.0 + a.abs()), "{a}, not {b}");
        }
    }
}

/// Long steps hide what frames and probes between them show.
#[test]
fn peaks_are_at_least_what_frames_and_probes_show() {
    let mut scene = parts();
    let every = Some(0.0031);
    scene.output.probes[0].every = every;
    for spring in &mut scene.springs {
        spring.damping = 0.0;
    }
    for method in METHODS {
        let scene = with(&scene, method, None, 0.02);
        for options in [
            RunOptions::default(),
            RunOptions::default().with_skip(false),
        ] {
            let (look, islands) = run(&scene, &options);
            let peaks = islands.peaks();
            let holds = |peak: &Peak, tension: f64| {
                (peak.min_tension..=peak.max_tension).contains(&tension)
            };
            for (time, tensions) in &look.frames {
                for (peak, tension) in peaks.iter().zip(tensions) {
                    assert!(
                        holds(peak, *tension),
                        "{method}: {peak:?}, {tension} at {time}"
                    );
                }
            }
            let of_springs = look.samples.iter().filter(|(_, probe, _)| *probe == 0);
            for (time, _, values) in of_springs {
                for (peak, tension) in peaks.iter().zip(values.iter().step_by(2)) {
                    assert!(
                        holds(peak, *tension),
                        "{method}: {peak:?}, {tension} at {time}"
                    );
                }
            }
        }
    }
}
