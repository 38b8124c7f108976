//! Numbers from Python, without a call per element, and numbers for Python, without a copy.

use crate::errors::Fault;
use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods as _, PyReadonlyArrayDyn,
    PyUntypedArrayMethods as _,
};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict as _;
use springs::scene::Vector3;

/// An array of floating-point numbers in C order; what is one already is not copied.
pub(crate) struct Floats<'py> {
    what: &'static str,
    array: PyReadonlyArrayDyn<'py, f64>,
}

impl<'py> Floats<'py> {
    /// Reads anything that numpy can make an array of; `what` names it in errors.
    pub(crate) fn new(what: &'static str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = as_array(what, value, "f8")?;
        let array = array.cast_into::<PyArrayDyn<f64>>()?.readonly();
        Ok(Self { what, array })
    }

    pub(crate) fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    pub(crate) fn numbers(&self) -> PyResult<&[f64]> {
        let slice = self.array.as_slice();
        slice.map_err(|error| Fault::scene(format!("{}: {error}", self.what)).into())
    }

    fn wrong_shape(&self, wanted: &str) -> PyErr {
        let shape = shape_text(self.shape());
        Fault::scene(format!(
            "{} must have the shape {wanted}, but has {shape}",
            self.what
        ))
        .into()
    }

    /// Rows of three: the shape (n, 3).
    pub(crate) fn vectors(&self) -> PyResult<Vec<Vector3<f64>>> {
        match self.shape() {
            [_, 3] => Ok(self.rows()?.collect()),
            _ => Err(self.wrong_shape("(n, 3)")),
        }
    }

    /// Rows of three of an array of n rows.
    pub(crate) fn n_vectors(&self, n: usize) -> PyResult<Vec<Vector3<f64>>> {
        if self.shape() == [n, 3] {
            Ok(self.rows()?.collect())
        } else {
            Err(self.wrong_shape(&format!("({n}, 3)")))
        }
    }

    fn rows(&self) -> PyResult<impl Iterator<Item = Vector3<f64>> + '_> {
        let (rows, _) = self.numbers()?.as_chunks::<3>();
        Ok(rows.iter().map(|row| Vector3::from(*row)))
    }

    /// One vector: the shape (3,).
    pub(crate) fn vector(&self) -> PyResult<Vector3<f64>> {
        match (self.shape(), self.numbers()?) {
            ([3], &[x, y, z]) => Ok(Vector3::new(x, y, z)),
            _ => Err(self.wrong_shape("(3,)")),
        }
    }

    /// A number for each of n: a scalar or the shape (n,).
    pub(crate) fn each(&self, n: usize) -> PyResult<Vec<f64>> {
        match (self.shape(), self.numbers()?) {
            ([], &[number]) => Ok(vec![number; n]),
            ([length], numbers) if *length == n => Ok(numbers.to_vec()),
            _ => Err(self.wrong_shape(&format!("() or ({n},)"))),
        }
    }

    /// Numbers in a row: the shape (m,).
    pub(crate) fn row(&self) -> PyResult<&[f64]> {
        match self.shape() {
            [_] => self.numbers(),
            _ => Err(self.wrong_shape("(m,)")),
        }
    }
}

/// A number for each of n, if there are any.
pub(crate) fn each(
    what: &'static str,
    value: Option<&Bound<'_, PyAny>>,
    n: usize,
) -> PyResult<Option<Vec<f64>>> {
    let read = value.map(|value| Floats::new(what, value)?.each(n));
    read.transpose()
}

fn as_array<'py>(what: &str, value: &Bound<'py, PyAny>, kind: &str) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    let options = [("dtype", kind), ("order", "C")].into_py_dict(py)?;
    let array = py
        .import("numpy")?
        .call_method("asarray", (value,), Some(&options));
    array.map_err(|cause| {
        let error = PyErr::from(Fault::scene(format!(
            "{what} is no array of numbers: {cause}"
        )));
        error.set_cause(py, Some(cause));
        error
    })
}

fn shape_text(shape: &[usize]) -> String {
    let numbers: Vec<String> = shape.iter().map(usize::to_string).collect();
    match &numbers[..] {
        [one] => format!("({one},)"),
        several => format!("({})", several.join(", ")),
    }
}

/// Whole numbers of any shape, none below zero.
fn whole(what: &'static str, value: &Bound<'_, PyAny>) -> PyResult<(Vec<usize>, Vec<usize>)> {
    let py = value.py();
    let array = py.import("numpy")?.call_method1("asarray", (value,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    let is_empty = array.getattr("size")?.extract::<usize>()? == 0;
    if !is_empty && !["i", "u"].contains(&kind.as_str()) {
        return Err(Fault::scene(format!("{what} must be whole numbers")).into());
    }
    let array = as_array(what, &array, "i8")?.cast_into::<PyArrayDyn<i64>>()?;
    let array = array.readonly();
    let shape = array.shape().to_vec();
    let numbers = array
        .as_slice()
        .map_err(|error| Fault::scene(error.to_string()))?;
    let whole = numbers.iter().map(|&number| {
        let index = usize::try_from(number);
        index.map_err(|_| Fault::scene(format!("{what}: there is no node {number}")).into())
    });
    Ok((whole.collect::<PyResult<_>>()?, shape))
}

/// Pairs of nodes: the shape (k, 2).
pub(crate) fn pairs(what: &'static str, value: &Bound<'_, PyAny>) -> PyResult<Vec<[usize; 2]>> {
    let (numbers, shape) = whole(what, value)?;
    let [_, 2] = shape[..] else {
        let shape = shape_text(&shape);
        let message = format!("{what} must have the shape (k, 2), but has {shape}");
        return Err(Fault::scene(message).into());
    };
    Ok(numbers.as_chunks::<2>().0.to_vec())
}

/// Some of n nodes: an index, indices, or an array of n truths.
pub(crate) fn some_nodes(value: &Bound<'_, PyAny>, n: usize) -> PyResult<Vec<usize>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("asarray", (value,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if kind == "b" {
        let shape: Vec<usize> = array.getattr("shape")?.extract()?;
        if shape != [n] {
            let shape = shape_text(&shape);
            let message = format!("a mask of nodes must have the shape ({n},), but has {shape}");
            return Err(Fault::scene(message).into());
        }
        let chosen = numpy.call_method1("flatnonzero", (array,))?;
        return Ok(whole("nodes", &chosen)?.0);
    }
    let (nodes, _) = whole("nodes", &array)?;
    match nodes.iter().find(|&&node| node >= n) {
        None => Ok(nodes),
        Some(&node) => {
            let message = format!("there is no node {node}: the scene has {n} of them");
            let fault = Fault::scene(message).advised(Some("nodes are counted from 0"));
            Err(fault.at_node(node).into())
        }
    }
}

/// Numbers in a row, handed over.
pub(crate) fn array1<T: numpy::Element>(py: Python<'_>, numbers: Vec<T>) -> Bound<'_, PyArray1<T>> {
    PyArray1::from_owned_array(py, Array1::from_vec(numbers))
}

/// Rows of n numbers, handed over.
pub(crate) fn array2<T: numpy::Element>(
    py: Python<'_>,
    numbers: Vec<T>,
    n: usize,
    rows: usize,
) -> Bound<'_, PyArray2<T>> {
    let array = Array2::from_shape_vec((rows, n), numbers).expect("rows of n numbers");
    PyArray2::from_owned_array(py, array)
}

/// Frames of n vectors, handed over.
pub(crate) fn array3(
    py: Python<'_>,
    numbers: Vec<f64>,
    n: usize,
    frames: usize,
) -> Bound<'_, PyArray3<f64>> {
    let array = Array3::from_shape_vec((frames, n, 3), numbers).expect("frames of n vectors");
    PyArray3::from_owned_array(py, array)
}

/// One vector after the other.
pub(crate) fn flat(vectors: &[Vector3<f64>]) -> Vec<f64> {
    vectors.iter().flatten().copied().collect()
}
