//! Lowest eigenpairs of K x = λ M x by block Lanczos iteration on a shifted inverse.

use crate::SolveError;
use crate::dense::symmetric_eigenpairs;
use faer::Mat;

/// K x = λ M x with symmetric K and positive semidefinite M, by what they do to
/// vectors of n numbers.
pub struct Pencil<'a> {
    /// Number of unknowns.
    pub n: usize,
    /// The second argument becomes K x.
    pub stiffness: &'a dyn Fn(&[f64], &mut [f64]),
    /// The second argument becomes M x.
    pub mass: &'a dyn Fn(&[f64], &mut [f64]),
    /// b becomes (K − σM)⁻¹ b. The shift σ is below all eigenvalues, so that K − σM is
    /// positive definite.
    pub shifted_inverse: &'a mut dyn FnMut(&mut [f64]) -> Result<(), SolveError>,
}

/// An eigenvalue λ and its vector, of which xᵀ M x = 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Eigenpair {
    /// λ = xᵀ K x.
    pub value: f64,
    /// x.
    pub vector: Vec<f64>,
}

/// What iteration for the lowest eigenpairs came to.
#[derive(Clone, Debug, PartialEq)]
pub struct LowestEigenpairs {
    /// In ascending order.
    pub pairs: Vec<Eigenpair>,
    /// Whether these are all that were asked for or that there are; else iteration stalled,
    /// and these are those that had converged.
    pub is_converged: bool,
}

/// The part of an eigenvector that may be wrong; of an eigenvalue it is the square.
const ACCURACY: f64 = 1e-9;
/// Rounds until iteration counts as stalled.
const MOST_ROUNDS: usize = 1000;
/// A vector is no new direction if orthogonalization leaves no more of it.
const DEPENDENT: f64 = 1e-11;

/// The `count` lowest eigenpairs in ascending order; fewer if there are no more with a
/// finite eigenvalue.
///
/// Block Lanczos with full orthogonalization in the product of M, thick restarts (Wu and
/// Simon, SIAM J. Matrix Anal. 22, 2000) and `block` vectors at a time: eigenvalues of a
/// higher multiplicity than that may be missed, which Sylvester's law can tell. Where M is
/// singular, vectors are purified by one more solution (Nour-Omid et al., Math. Comp. 48,
/// 1987).
///
/// # Errors
///
/// Those of `shifted_inverse`.
pub fn lowest_eigenpairs(
    pencil: &mut Pencil<'_>,
    count: usize,
    block: usize,
) -> Result<LowestEigenpairs, SolveError> {
    let block = block.clamp(1, pencil.n.max(1));
    let mut krylov = Krylov::default();
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut fresh = |n: usize| -> Vec<Vec<f64>> {
        let vector = |_| (0..n).map(|_| random.next()).collect();
        (0..block).map(vector).collect()
    };
    let most = 2 * count + 6 * block;
    let mut candidates = fresh(pencil.n);
    for vector in &mut candidates {
        invert(pencil, vector)?;
    }
    // Whether the candidates came by chance.
    let mut is_by_chance = true;
    for _ in 0..MOST_ROUNDS {
        let before = krylov.basis.len();
        krylov.extend(pencil, candidates)?;
        let is_new = krylov.basis.len() > before;
        let ritz = krylov.ritz();
        let wanted = count.min(ritz.len());
        let residuals = krylov.residuals(pencil, &ritz, wanted);
        let open: Vec<&Residual> = residuals
            .iter()
            .filter(|residual| residual.part > ACCURACY)
            .collect();
        if open.is_empty() && (wanted == count || (!is_new && is_by_chance)) {
            return Ok(LowestEigenpairs {
                pairs: krylov.pairs(pencil, ritz[..wanted].iter()),
                is_converged: true,
            });
        }
        if is_new && krylov.basis.len() < most {
            candidates = krylov.images[before..].to_vec();
            is_by_chance = false;
            continue;
        }
        // Residuals lead out of the subspace; if they do not, chance may.
        candidates = open
            .iter()
            .take(block)
            .map(|one| one.vector.clone())
            .collect();
        is_by_chance = !is_new || candidates.is_empty();
        if is_by_chance {
            candidates = fresh(pencil.n);
            for vector in &mut candidates {
                invert(pencil, vector)?;
            }
        }
        if krylov.basis.len() >= most {
            krylov.restart(&ritz, count + block);
        }
    }
    let ritz = krylov.ritz();
    let wanted = count.min(ritz.len());
    let residuals = krylov.residuals(pencil, &ritz, wanted);
    let with_residuals = ritz.iter().zip(&residuals);
    let converged = with_residuals.filter(|(_, residual)| residual.part <= ACCURACY);
    Ok(LowestEigenpairs {
        pairs: krylov.pairs(pencil, converged.map(|(one, _)| one)),
        is_converged: false,
    })
}

/// x becomes (K − σM)⁻¹ M x.
fn invert(pencil: &mut Pencil<'_>, x: &mut [f64]) -> Result<(), SolveError> {
    let from = x.to_vec();
    (pencil.mass)(&from, x);
    (pencil.shifted_inverse)(x)
}

/// A basis that is orthonormal in the product of M, and its images.
#[derive(Default)]
struct Krylov {
    basis: Vec<Vec<f64>>,
    images: Vec<Vec<f64>>,
    /// Products of every vector of the basis with the images up to its own.
    products: Vec<Vec<f64>>,
}

/// θ, largest first, and the coordinates of its vector.
struct Ritz {
    theta: f64,
    coordinates: Vec<f64>,
}

struct Residual {
    /// Of the vector, relative.
    part: f64,
    vector: Vec<f64>,
}

impl Krylov {
    /// Takes what is new in some vectors.
    fn extend(
        &mut self,
        pencil: &mut Pencil<'_>,
        candidates: Vec<Vec<f64>>,
    ) -> Result<(), SolveError> {
        let mut image = vec![0.0; pencil.n];
        for mut vector in candidates {
            let norm = |vector: &[f64], image: &mut [f64]| {
                (pencil.mass)(vector, image);
                dot(vector, image).max(0.0).sqrt()
            };
            let whole = norm(&vector, &mut image);
            for _ in 0..2 {
                for direction in &self.basis {
                    let part = dot(direction, &image);
                    add_multiple(&mut vector, direction, -part);
                }
                let rest = norm(&vector, &mut image);
                // What is not a number is no direction either.
                let is_new = rest > DEPENDENT * whole;
                if !is_new {
                    vector.clear();
                    break;
                }
            }
            if vector.is_empty() {
                continue;
            }
            let scale = 1.0 / norm(&vector, &mut image);
            vector.iter_mut().for_each(|x| *x *= scale);
            let mut mapped = vector.clone();
            invert(pencil, &mut mapped)?;
            (pencil.mass)(&mapped, &mut image);
            self.basis.push(vector);
            let products = self.basis.iter().map(|other| dot(other, &image));
            self.products.push(products.collect());
            self.images.push(mapped);
        }
        Ok(())
    }

    fn ritz(&self) -> Vec<Ritz> {
        let m = self.basis.len();
        let matrix = Mat::from_fn(m, m, |i, j| self.products[i.max(j)][i.min(j)]);
        let Ok((values, vectors)) = symmetric_eigenpairs(matrix) else {
            return Vec::new();
        };
        let pairs = (0..m).rev().map(|k| Ritz {
            theta: values[k],
            coordinates: (0..m).map(|i| vectors[(i, k)]).collect(),
        });
        pairs.collect()
    }

    fn residuals(&self, pencil: &Pencil<'_>, ritz: &[Ritz], wanted: usize) -> Vec<Residual> {
        let mut image = vec![0.0; pencil.n];
        let residual = |one: &Ritz| {
            let mut vector = combine(&self.images, &one.coordinates);
            let of_basis = combine(&self.basis, &one.coordinates);
            add_multiple(&mut vector, &of_basis, -one.theta);
            (pencil.mass)(&vector, &mut image);
            let size = dot(&vector, &image).max(0.0).sqrt();
            Residual {
                part: size / one.theta.abs().max(f64::MIN_POSITIVE),
                vector,
            }
        };
        ritz[..wanted].iter().map(residual).collect()
    }

    /// Keeps the best vectors only.
    fn restart(&mut self, ritz: &[Ritz], kept: usize) {
        let kept = &ritz[..kept.min(ritz.len())];
        let all = |vectors: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let combined = kept.iter().map(|one| combine(vectors, &one.coordinates));
            combined.collect()
        };
        let (basis, images) = (all(&self.basis), all(&self.images));
        (self.basis, self.images) = (basis, images);
        let products = kept.iter().enumerate().map(|(row, one)| {
            let mut products = vec![0.0; row + 1];
            products[row] = one.theta;
            products
        });
        self.products = products.collect();
    }

    fn pairs<'r>(
        &self,
        pencil: &Pencil<'_>,
        ritz: impl Iterator<Item = &'r Ritz>,
    ) -> Vec<Eigenpair> {
        let mut image = vec![0.0; pencil.n];
        let pair = |one: &Ritz| {
            let mut vector = combine(&self.images, &one.coordinates);
            (pencil.mass)(&vector, &mut image);
            let scale = 1.0 / dot(&vector, &image).sqrt();
            vector.iter_mut().for_each(|x| *x *= scale);
            (pencil.stiffness)(&vector, &mut image);
            Eigenpair {
                value: dot(&vector, &image),
                vector,
            }
        };
        let mut pairs: Vec<Eigenpair> = ritz.map(pair).collect();
        pairs.sort_by(|a, b| a.value.total_cmp(&b.value));
        pairs
    }
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    let [product] = crate::direct::dots_in_lanes::<1, 16>([x], y);
    product
}

fn add_multiple(y: &mut [f64], x: &[f64], a: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

fn combine(vectors: &[Vec<f64>], coordinates: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; vectors.first().map_or(0, Vec::len)];
    for (vector, &coordinate) in vectors.iter().zip(coordinates) {
        add_multiple(&mut sum, vector, coordinate);
    }
    sum
}

/// Numbers between −1 and 1, always the same (xorshift64*: Vigna, ACM TOMS 42, 2016).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
        bits as f64 / 2f64.powi(52) - 1.0
    }
}
