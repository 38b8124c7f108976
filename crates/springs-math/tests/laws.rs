//! Every law of a spring against what it says of itself: slopes, edges, bounds.

use nalgebra::{Matrix3, SVector, Vector3};
use num_dual::{DualNum, hessian};
use springs_math::law::{
    Bilinear, CompressionOnly, Law, Point, Polynomial, Power, StrainLimit, Table, TableError,
    TensionOnly,
};
use springs_math::spring::{self, LengthLaw, Spring};

/// A law, the lengths where it changes its form, and how many derivatives of V are
/// continuous there.
struct Case {
    name: &'static str,
    law: Law,
    edges: Vec<f64>,
    n_continuous: usize,
}

fn table(points: &[(f64, f64)], rest_length: f64) -> Result<Table, TableError> {
    let point = |&(strain, tension): &(f64, f64)| Point { strain, tension };
    Table::new(&points.iter().map(point).collect::<Vec<_>>(), rest_length)
}

const RISING: [(f64, f64); 6] = [
    (-0.4, -30.0),
    (-0.1, -2.0),
    (0.0, 0.0),
    (0.05, 0.0),
    (0.2, 20.0),
    (0.5, 25.0),
];
const FALLING_TOO: [(f64, f64); 5] = [
    (-0.5, -4.0),
    (-0.2, -6.0),
    (0.1, 3.0),
    (0.3, 1.0),
    (0.4, 8.0),
];

fn cases() -> Vec<Case> {
    let bilinear = |stiffness, compression, blend| {
        Law::Bilinear(Bilinear {
            stiffness,
            compression,
            rest_length: 2.0,
            blend,
        })
    };
    let limit = |blend| {
        Law::StrainLimit(StrainLimit {
            spring: Spring {
                stiffness: 30.0,
                rest_length: 2.0,
            },
            strain: 0.25,
            stiffness: 500.0,
            blend,
        })
    };
    let polynomial = |coefficients: &[f64]| {
        Law::Polynomial(Polynomial {
            coefficients: coefficients.to_vec(),
            rest_length: 2.0,
        })
    };
    let power = |exponent| {
        Law::Power(Power {
            stiffness: 30.0,
            exponent,
            rest_length: 2.0,
        })
    };
    let cable = |blend| {
        Law::TensionOnly(TensionOnly {
            stiffness: 30.0,
            rest_length: 2.0,
            blend,
        })
    };
    let contact = |blend| {
        Law::CompressionOnly(CompressionOnly {
            stiffness: 30.0,
            rest_length: 2.0,
            blend,
        })
    };
    let knots = |points: &[(f64, f64)]| -> Vec<f64> {
        points.iter().map(|point| 2.0 * (1.0 + point.0)).collect()
    };
    let of = |name, law, edges: &[f64], n_continuous| Case {
        name,
        law,
        edges: edges.to_vec(),
        n_continuous,
    };
    vec![
        of(
            "linear",
            Law::Linear(Spring::of_axial_stiffness(60.0, 2.0)),
            &[],
            3,
        ),
        of("cable", cable(0.25), &[2.0, 2.5], 3),
        of("sharp cable", cable(0.0), &[2.0], 1),
        of("contact", contact(0.25), &[2.0, 1.5], 3),
        of("sharp contact", contact(0.0), &[2.0], 1),
        of(
            "stiffer stretched",
            bilinear(30.0, 4.0, 0.25),
            &[2.0, 2.5],
            3,
        ),
        of(
            "stiffer compressed",
            bilinear(4.0, 30.0, 0.25),
            &[2.0, 1.5],
            3,
        ),
        of("sharp bilinear", bilinear(30.0, 4.0, 0.0), &[2.0], 1),
        of("limit", limit(0.125), &[1.5, 2.5, 1.25, 2.75], 3),
        of("sharp limit", limit(0.0), &[1.5, 2.5], 1),
        of("alpha", polynomial(&[10.0, 4.0]), &[], 3),
        of("beta", polynomial(&[10.0, 0.0, 7.0]), &[], 3),
        of("softening", polynomial(&[10.0, -4.0, 1.0, 0.5]), &[], 3),
        of("one coefficient", polynomial(&[10.0]), &[], 3),
        of("no coefficient", polynomial(&[]), &[], 3),
        of("Hertz", power(1.5), &[2.0], 2),
        of("square", power(2.0), &[2.0], 2),
        of("cubic", power(3.0), &[2.0], 3),
        of("first power", power(1.0), &[2.0], 3),
        of(
            "table",
            Law::Table(table(&RISING, 2.0).unwrap()),
            &knots(&RISING),
            2,
        ),
        of(
            "falling table",
            Law::Table(table(&FALLING_TOO, 2.0).unwrap()),
            &knots(&FALLING_TOO),
            2,
        ),
        of(
            "two points",
            Law::Table(table(&[(-0.1, -5.0), (0.2, 10.0)], 2.0).unwrap()),
            &[1.8, 2.4],
            3,
        ),
    ]
}

/// Lengths up to 6 m, with an edge in none of the intervals ±1e-3, nor the edge of a
/// fractional power, with its large high derivatives, in ±0.1.
fn smooth_lengths(case: &Case) -> impl Iterator<Item = f64> {
    let is_fractional = matches!(&case.law, Law::Power(law) if law.exponent.fract() != 0.0);
    let margin = if is_fractional { 0.1 } else { 1e-3 };
    (2..3000)
        .map(|k| 0.00201 * f64::from(k))
        .filter(move |l| case.edges.iter().all(|edge| (l - edge).abs() > margin))
}

/// Central differences of order 4 with h = 4e-4: truncation below h⁴ fifth
/// derivatives, rounding 1e-16/h of the values; both below 1e-9 of 1e3 N.
fn difference(f: impl Fn(f64) -> f64, at: f64) -> f64 {
    let h = 4e-4;
    (8.0 * (f(at + h) - f(at - h)) - (f(at + 2.0 * h) - f(at - 2.0 * h))) / (12.0 * h)
}

#[test]
fn tension_and_stiffness_are_slopes() {
    for case in cases() {
        let law = &case.law;
        for l in smooth_lengths(&case) {
            let scale = 1.0 + law.energy(l).abs() + law.tension(l).abs() + law.stiffness(l).abs();
            let off = (difference(|l| law.energy(l), l) - law.tension(l)).abs();
            assert!(off < 1e-9 * scale, "{}: tension at {l}: {off:e}", case.name);
            let off = (difference(|l| law.tension(l), l) - law.stiffness(l)).abs();
            assert!(
                off < 1e-9 * scale,
                "{}: stiffness at {l}: {off:e}",
                case.name
            );
        }
    }
}

/// V, T, k and differences of k on both sides of every edge: jumps are gone with the
/// distance where they are said to be, and they are there where not.
#[test]
fn edges_are_as_smooth_as_said() {
    for case in cases() {
        let law = &case.law;
        for &edge in &case.edges {
            let jump = |of: &dyn Fn(f64) -> f64, d: f64| (of(edge + d) - of(edge - d)).abs();
            let curvature =
                |l: f64, d: f64| (law.stiffness(l + d) - law.stiffness(l - d)) / (2.0 * d);
            let scale = 1e3;
            for d in [1e-5, 1e-7, 1e-9] {
                assert!(jump(&|l| law.energy(l), d) < 1e3 * d, "{}", case.name);
                assert!(jump(&|l| law.tension(l), d) < 1e4 * d, "{}", case.name);
                let bound = match case.n_continuous {
                    1 => scale,
                    // Power 3/2 goes with the root of the distance.
                    2 => 1e2 * d.sqrt() + 1e4 * d,
                    _ => 1e5 * d,
                };
                let off = jump(&|l| law.stiffness(l), d);
                assert!(off < bound, "{} at {edge}, {d:e}: {off:e}", case.name);
            }
            if case.n_continuous >= 3 {
                for d in [1e-3, 1e-4] {
                    let off = jump(&|l| curvature(l, 0.5 * d), d);
                    assert!(off < 1e6 * d, "{} at {edge}: {off:e}", case.name);
                }
            }
            if case.n_continuous == 1 {
                assert!(jump(&|l| law.stiffness(l), 1e-9) > 1.0, "{}", case.name);
            }
        }
    }
}

#[test]
fn bounds_hold_at_every_length() {
    for case in cases() {
        let law = &case.law;
        let bound = law.largest_stiffness();
        let lengths = (1..400_000).map(|k| 1e-5 * f64::from(k));
        let magnitudes = (-190..150).map(|k| 10f64.powi(k));
        let mut largest = f64::NEG_INFINITY;
        for l in lengths.chain(magnitudes) {
            let k = law.stiffness(l);
            largest = largest.max(k).max(law.tension(l) / l);
            assert!(!law.is_convex() || k >= 0.0, "{} at {l}: {k:e}", case.name);
        }
        assert!(
            largest <= bound * (1.0 + 1e-14),
            "{}: {largest:e} of {bound:e}",
            case.name
        );
        // Where there is a bound it is attained.
        assert!(
            bound == f64::INFINITY || largest >= bound * (1.0 - 1e-8),
            "{}: {largest:e} of {bound:e}",
            case.name
        );
    }
}

/// Polynomials are recognized as convex where pairs of coefficients tell.
#[test]
fn convex_polynomials() {
    let is_convex = |coefficients: &[f64]| {
        let coefficients = coefficients.to_vec();
        let rest_length = 2.0;
        Polynomial {
            coefficients,
            rest_length,
        }
        .is_convex()
    };
    assert!(is_convex(&[10.0, 5.0]) && is_convex(&[10.0, 0.0, 7.0]) && is_convex(&[]));
    // k = 10 + 10.2 ε is negative at ε = −1.
    assert!(!is_convex(&[10.0, 5.1]) && !is_convex(&[10.0, -4.0]) && !is_convex(&[-1.0]));
}

#[test]
fn no_length_gives_nan() {
    let mut laws: Vec<Law> = cases().into_iter().map(|case| case.law).collect();
    // Nothing in them where a product with the length could be 0·∞.
    laws.push(Law::Bilinear(Bilinear {
        stiffness: 3.0,
        compression: 3.0,
        rest_length: 0.0,
        blend: 0.1,
    }));
    laws.push(Law::StrainLimit(StrainLimit {
        spring: Spring {
            stiffness: 0.0,
            rest_length: 1.0,
        },
        strain: 0.0,
        stiffness: 0.0,
        blend: 0.0,
    }));
    laws.push(Law::Power(Power {
        stiffness: 0.0,
        exponent: 4.0,
        rest_length: 1e-10,
    }));
    laws.push(Law::Polynomial(Polynomial {
        coefficients: vec![1.0, 0.0, -2.0, 0.0],
        rest_length: 1e-10,
    }));
    for law in laws {
        for l in [0.0, 5e-324, 1e-200, 1.0, 1e100, 1e160, 1e300, f64::MAX] {
            assert!(!law.energy(l).is_nan(), "{law:?}: energy at {l:e}");
            assert!(!law.tension(l).is_nan(), "{law:?}: tension at {l:e}");
            assert!(!law.stiffness(l).is_nan(), "{law:?}: stiffness at {l:e}");
        }
    }
}

#[test]
fn there_is_no_tension_and_no_energy_at_rest() {
    for case in cases() {
        let rest = case.law.rest_length();
        assert!(case.law.tension(rest).abs() < 1e-13, "{}", case.name);
        assert!(case.law.energy(rest).abs() < 1e-14, "{}", case.name);
    }
}

/// By hand, with K = 30 N/m, l₀ = 2 m, w = 0.5 m.
#[test]
fn blends_by_hand() {
    let cable = TensionOnly {
        stiffness: 30.0,
        rest_length: 2.0,
        blend: 0.25,
    };
    for l in [0.0, 1.0, 2.0] {
        assert_eq!(
            [cable.energy(l), cable.tension(l), cable.stiffness(l)],
            [0.0; 3]
        );
    }
    // u = 1/2: r = w (6/8 − 8/16 + 3/32) = 0.171875 m, ∫ = w² 0.0515625, r′ = 1.4375.
    let off = [
        cable.energy(2.25) - 30.0 * 0.25 * 0.0515625,
        cable.tension(2.25) - 30.0 * 0.171875,
        cable.stiffness(2.25) - 30.0 * 1.4375,
        // Beyond the blend: ½Ks² − Kw²/10.
        cable.energy(3.0) - (15.0 - 0.75),
        cable.tension(3.0) - 30.0,
        cable.stiffness(3.0) - 30.0,
        // The largest stiffness is at u = 3/5.
        cable.stiffness(2.3) - cable.largest_stiffness(),
    ];
    assert!(off.iter().all(|off| off.abs() < 1e-13), "{off:?}");
    let contact = CompressionOnly {
        stiffness: 30.0,
        rest_length: 2.0,
        blend: 0.25,
    };
    for s in [-1.5, -0.75, -0.25, 0.0, 0.125, 0.5] {
        assert_eq!(contact.energy(2.0 + s), cable.energy(2.0 - s));
        assert_eq!(contact.tension(2.0 + s), -cable.tension(2.0 - s));
        assert_eq!(contact.stiffness(2.0 + s), cable.stiffness(2.0 - s));
    }
}

#[test]
fn closed_energies() {
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-13 * b.abs().max(1.0), "{a} {b}");
    let linear = Spring::of_axial_stiffness(60.0, 2.0);
    assert_eq!(linear.stiffness, 30.0);
    close(linear.tension(2.5), 60.0 * 0.25);
    let limit = StrainLimit {
        spring: linear,
        strain: 0.25,
        stiffness: 500.0,
        blend: 0.0,
    };
    for (l, beyond) in [(3.0, 0.5), (1.2, 0.3), (2.1, 0.0)] {
        close(limit.energy(l), linear.energy(l) + 250.0 * beyond * beyond);
    }
    let bilinear = Bilinear {
        stiffness: 30.0,
        compression: 4.0,
        rest_length: 2.0,
        blend: 0.0,
    };
    close(bilinear.energy(3.0), 15.0);
    close(bilinear.energy(1.0), 2.0);
    close(bilinear.tension(1.0), -4.0);
    // ε = 1/2: V = 2 (10/8 + 4/24 + 7/64).
    let polynomial = Polynomial {
        coefficients: vec![10.0, 4.0, 7.0],
        rest_length: 2.0,
    };
    close(
        polynomial.energy(3.0),
        2.0 * (1.25 + 4.0 / 24.0 + 7.0 / 64.0),
    );
    close(polynomial.tension(3.0), 5.0 + 1.0 + 0.875);
    // Hertz with C = 8 N/m^{3/2}, d = 0.49 m.
    let hertz = Power {
        stiffness: 8.0 * 2f64.sqrt(),
        exponent: 1.5,
        rest_length: 2.0,
    };
    close(hertz.tension(1.51), -8.0 * 0.343);
    close(hertz.energy(1.51), 8.0 * 0.343 * 0.49 / 2.5);
    close(hertz.stiffness(1.51), 1.5 * 8.0 * 0.7);
    close(hertz.tension(2.49), 8.0 * 0.343);
}

#[test]
fn tables_go_through_their_points_and_are_monotone_between() {
    for points in [&RISING[..], &FALLING_TOO] {
        let law = table(points, 2.0).unwrap();
        for pair in points.windows(2) {
            let [(start, from), (end, to)] = [pair[0], pair[1]];
            let at = |part: f64| law.tension(2.0 * (1.0 + start + part * (end - start)));
            assert!((at(0.0) - from).abs() < 1e-12 && (at(1.0) - to).abs() < 1e-12);
            for k in 0..1000 {
                let change = at(f64::from(k + 1) / 1e3) - at(f64::from(k) / 1e3);
                assert!(change * (to - from).signum() >= -1e-12, "{change:e}");
            }
        }
    }
    // Lines beyond the ends with the slopes of the first and last points.
    let law = table(&RISING, 2.0).unwrap();
    let last = law.stiffness(3.0);
    for l in [3.5, 10.0, 1e6] {
        assert_eq!(law.stiffness(l), last);
        let off = law.tension(l) - 25.0 - last * (l - 3.0);
        assert!(off.abs() < 1e-12 * l, "{off:e}");
    }
}

/// Points on T = exp(3ε) − 1: away from the ends, where slopes are those of
/// lines, the table errs by the cube of the distance of its points.
#[test]
fn tables_of_smooth_laws_converge() {
    let off = |n: i32| -> f64 {
        let tension = |strain: f64| (3.0 * strain).exp() - 1.0;
        let points: Vec<_> = (0..=n)
            .map(|k| f64::from(k) / f64::from(n) - 0.5)
            .map(|strain| (strain, tension(strain)))
            .collect();
        let law = table(&points, 1.0).unwrap();
        let inner = (0..1000).map(|k| 0.6 * f64::from(k) / 1e3 - 0.3);
        inner.fold(0.0, |off, strain| {
            f64::max(off, (law.tension(1.0 + strain) - tension(strain)).abs())
        })
    };
    let rate = (off(20) / off(40)).log2();
    assert!(rate > 2.9, "order {rate}: {:e}, {:e}", off(20), off(40));
}

/// A table read backwards is the same law of the negative strain.
#[test]
fn tables_do_not_depend_on_direction() {
    let law = table(&RISING, 2.0).unwrap();
    let mirrored: Vec<_> = RISING.iter().rev().map(|&(e, t)| (-e, -t)).collect();
    let mirrored = table(&mirrored, 2.0).unwrap();
    for k in -150..=150 {
        let s = 0.01 * f64::from(k);
        assert!((law.tension(2.0 + s) + mirrored.tension(2.0 - s)).abs() < 1e-12);
        assert!((law.energy(2.0 + s) - mirrored.energy(2.0 - s)).abs() < 1e-12);
    }
}

#[test]
fn tables_find_their_rest_length() {
    let rest = |points: &[(f64, f64)]| table(points, 2.0).map(|law| law.rest_length());
    // At a point, between two, on a flat part, on a line beyond the ends.
    assert_eq!(rest(&RISING), Ok(2.0));
    assert_eq!(rest(&[(-0.1, -5.0), (0.0, 0.0), (0.1, 9.0)]), Ok(2.0));
    let between = rest(&[(0.0, -2.0), (0.4, 2.0)]).unwrap();
    assert!((between - 2.4).abs() < 1e-15);
    assert_eq!(rest(&[(-0.3, 0.0), (-0.1, 0.0), (0.1, 3.0)]), Ok(1.8));
    let beyond = rest(&[(0.0, 1.0), (0.1, 2.0)]).unwrap();
    assert!((beyond - 1.8).abs() < 1e-15);
    let beyond = rest(&[(0.0, -2.0), (0.1, -1.0)]).unwrap();
    assert!((beyond - 2.4).abs() < 1e-15);
    // The nearest of three.
    let several = rest(&[(-0.5, 1.0), (-0.2, -1.0), (0.05, 1.0), (0.4, -1.0)]).unwrap();
    assert!((several - 1.85).abs() < 0.05);
    // It pulls always: it ends at a point, and T/l has no bound.
    let pulls = table(&[(0.0, 5.0), (0.1, 5.0)], 2.0).unwrap();
    assert_eq!(pulls.rest_length(), 0.0);
    assert_eq!(pulls.largest_stiffness(), f64::INFINITY);
    assert!((pulls.energy(1.0) - 5.0).abs() < 1e-15);
    assert_eq!(
        rest(&[(0.0, -5.0), (0.1, -5.0)]),
        Err(TableError::NeverAtRest)
    );
    // Another length, the same strains.
    let law = table(&RISING, 2.0).unwrap().with_rest_length(4.0).unwrap();
    assert!((law.tension(4.8) - 20.0).abs() < 1e-12);
}

#[test]
fn bad_tables_are_errors() {
    let error = |points: &[(f64, f64)], rest_length| table(points, rest_length).unwrap_err();
    for n_points in 0..2 {
        assert_eq!(
            error(&RISING[..n_points], 1.0),
            TableError::TooFewPoints { n_points }
        );
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let point = 1;
        assert_eq!(
            error(&[(0.0, 0.0), (bad, 1.0)], 1.0),
            TableError::NotFinite { point }
        );
        assert_eq!(
            error(&[(0.0, 0.0), (1.0, bad)], 1.0),
            TableError::NotFinite { point }
        );
    }
    let steep = [(0.0, 0.0), (1.0, 1.0), (1.0 + f64::EPSILON, 1e300)];
    assert_eq!(error(&steep, 1.0), TableError::NotFinite { point: 1 });
    for strain in [0.1, 0.0] {
        let points = [(-0.1, 0.0), (0.1, 1.0), (strain, 2.0)];
        assert_eq!(error(&points, 1.0), TableError::NotAscending { point: 2 });
    }
    for rest_length in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(
            error(&RISING, rest_length),
            TableError::RestLength { rest_length }
        );
    }
    assert!(matches!(
        error(&RISING, f64::NAN),
        TableError::RestLength { .. }
    ));
}

fn length<T: DualNum<Primitive = f64>>(x0: &SVector<T, 3>, x1: &Vector3<f64>) -> T {
    let d: [T; 3] = std::array::from_fn(|k| -x0[k].clone() + x1[k]);
    (d[0].clone() * d[0].clone() + d[1].clone() * d[1].clone() + d[2].clone() * d[2].clone()).sqrt()
}

/// With ∇l and ∇²l by dual numbers, f = −T ∇l and H = k ∇l ∇lᵀ + T ∇²l.
#[test]
fn force_and_hessian_follow_from_the_law() {
    let direction = Vector3::new(0.48, -0.6, 0.64);
    for case in cases() {
        for l in [0.3, 1.4, 1.9, 2.0, 2.2, 2.6, 4.0] {
            let (x0, x1) = (Vector3::new(0.1, 0.2, -0.3), direction * l);
            let x1 = x1 + x0;
            let (l, slope, second): (f64, _, Matrix3<f64>) = hessian(|x0| length(&x0, &x1), &x0);
            let (tension, stiffness) = (case.law.tension(l), case.law.stiffness(l));
            let force = spring::force(&case.law, &x0, &x1);
            // k changes by up to 1e4 N/m² and l by rounding.
            assert!((force + slope * tension).amax() < 1e-11, "{}", case.name);
            let expected = slope * slope.transpose() * stiffness + second * tension;
            let block = spring::hessian_block(&case.law, &x0, &x1);
            let off = (block - expected).amax();
            let is_kink = case.edges.iter().any(|edge| (l - edge).abs() < 1e-9);
            assert!(is_kink || off < 1e-10, "{} at {l}: {off:e}", case.name);
        }
    }
}
