//! Laws of springs.

use crate::arrays::Floats;
use crate::errors::Fault;
use pyo3::prelude::*;
use springs::scene::SpringLaw;

/// How the tension of a spring depends on its length, if not linearly; strain is
/// length / rest length - 1.
#[pyclass(module = "springs", name = "Law", frozen)]
#[derive(Clone)]
pub(crate) struct PyLaw(SpringLaw);

impl PyLaw {
    fn new(law: SpringLaw) -> PyResult<Self> {
        match law.fault() {
            None => Ok(Self(law)),
            Some(fault) => Err(Fault::scene(fault.to_string()).into()),
        }
    }
}

#[pymethods]
impl PyLaw {
    /// Pulls and does not push; `blend` is the strain within which it sets in.
    #[staticmethod]
    #[pyo3(signature = (blend=SpringLaw::BLEND))]
    fn tension_only(blend: f64) -> PyResult<Self> {
        Self::new(SpringLaw::TensionOnly { blend })
    }

    /// Pushes and does not pull.
    #[staticmethod]
    #[pyo3(signature = (blend=SpringLaw::BLEND))]
    fn compression_only(blend: f64) -> PyResult<Self> {
        Self::new(SpringLaw::CompressionOnly { blend })
    }

    /// The stiffness `compression`, in N/m, where the spring is shorter than at rest.
    #[staticmethod]
    #[pyo3(signature = (compression, blend=SpringLaw::BLEND))]
    fn bilinear(compression: f64, blend: f64) -> PyResult<Self> {
        Self::new(SpringLaw::Bilinear { compression, blend })
    }

    /// Stiffer by `stiffness`, in N/m, beyond strains of plus or minus `strain`.
    #[staticmethod]
    #[pyo3(signature = (strain, stiffness, blend=SpringLaw::BLEND))]
    fn limit(strain: f64, stiffness: f64, blend: f64) -> PyResult<Self> {
        Self::new(SpringLaw::Limit {
            strain,
            stiffness,
            blend,
        })
    }

    /// The strain to the power of `exponent`, which is at least 1.
    #[staticmethod]
    fn power(exponent: f64) -> PyResult<Self> {
        Self::new(SpringLaw::Power { exponent })
    }

    /// Yields at tensions of plus or minus `yields_at`, in N, with the stiffness `hardening`,
    /// in N/m, from there on, and keeps what it has yielded by.
    #[staticmethod]
    #[pyo3(signature = (yields_at, hardening=0.0))]
    fn plastic(yields_at: f64, hardening: f64) -> PyResult<Self> {
        Self::new(SpringLaw::Plastic {
            yields_at,
            hardening,
        })
    }

    /// a1 e + a2 e**2 + ... in N, of the strain e; `coefficients` (m,).
    #[staticmethod]
    fn polynomial(coefficients: &Bound<'_, PyAny>) -> PyResult<Self> {
        let coefficients = Floats::new("coefficients", coefficients)?;
        Self::new(SpringLaw::Polynomial(coefficients.row()?.into()))
    }

    /// A smooth curve through `points` (m, 2) of strain and tension in N.
    #[staticmethod]
    fn table(points: &Bound<'_, PyAny>) -> PyResult<Self> {
        let points = Floats::new("points", points)?;
        let [_, 2] = points.shape() else {
            return Err(Fault::scene("points must have the shape (m, 2)").into());
        };
        let (points, _) = points.numbers()?.as_chunks::<2>();
        Self::new(SpringLaw::Table(points.into()))
    }

    fn __repr__(&self) -> String {
        format!("<springs.Law {:?}>", self.0)
    }
}

/// A law, or the name of one that needs no numbers; `None` for the linear one.
pub(crate) fn law(value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<SpringLaw>> {
    let Some(value) = value else {
        return Ok(None);
    };
    if let Ok(law) = value.cast::<PyLaw>() {
        return Ok(Some(law.get().0.clone()));
    }
    let blend = SpringLaw::BLEND;
    match value.extract::<String>().as_deref() {
        Ok("linear") => Ok(None),
        Ok("tension-only") => Ok(Some(SpringLaw::TensionOnly { blend })),
        Ok("compression-only") => Ok(Some(SpringLaw::CompressionOnly { blend })),
        _ => Err(Fault::scene("there is no such law")
            .advised(Some(
                "known are linear, tension-only, compression-only, and those that springs.Law makes",
            ))
            .into()),
    }
}
