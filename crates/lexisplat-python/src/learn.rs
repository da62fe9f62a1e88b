//! Learns dictionaries of rows of any length, and codes rows over them.

use lexisplat::learn::{DEFAULT_MOMENTUM, LearnOptions, Statistics as Sums, learn_atoms};
use lexisplat::pursuit::{Coder, RowCodes, RowValue, StopRule, ValueType, encode_rows as encode_all};
use lexisplat::{Atoms, Pursuit};
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::{Result, parameter, raise};
use crate::work::without_gil;

/// Row starts, atoms, values in the type of the rows, the error of each row, and the numbers of rows that are not within
/// the tolerance.
type Codes<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyAny>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
);

/// The rule for coding rows, in Python's terms: `tol`, `max_nonzeros`, `pursuit`.
#[derive(FromPyObject)]
pub(crate) struct Rule(Option<f64>, Option<usize>, String);

impl Rule {
    fn stop(&self) -> Result<StopRule> {
        Ok(StopRule::new(self.0, self.1)?)
    }

    fn pursuit(&self) -> Result<Pursuit> {
        Ok(self.2.parse()?)
    }

    fn coder(&self, atoms: &Atoms) -> Result<Coder> {
        Ok(Coder::over(atoms, self.pursuit()?, self.stop()?, ValueType::F32))
    }
}

/// Rows in single or double precision.
#[derive(FromPyObject)]
pub(crate) enum Rows<'py> {
    #[pyo3(transparent)]
    Single(PyReadonlyArray2<'py, f32>),
    #[pyo3(transparent)]
    Double(PyReadonlyArray2<'py, f64>),
}

/// Evaluates `$work` with the rows of `$given`, which are called `$rows` in it, for either type of rows.
macro_rules! for_rows {
    ($given:expr, $rows:ident => $work:expr) => {
        match $given {
            Rows::Single($rows) => $work,
            Rows::Double($rows) => $work,
        }
    };
}

/// Returns the length of a row and a copy of the values of `rows`. A copy is needed because other threads may change an
/// array while the GIL is not held.
fn copied<T: Element + Copy>(rows: &PyReadonlyArray2<'_, T>) -> (usize, Vec<T>) {
    let dim = rows.shape()[1];
    let values = match rows.as_slice() {
        Ok(values) => values.to_vec(),
        Err(_) => rows.as_array().iter().copied().collect(),
    };
    (dim, values)
}

fn atoms_of(components: &PyReadonlyArray2<'_, f32>) -> PyResult<Atoms> {
    let (dim, values) = copied(components);
    Atoms::new(dim, values).map_err(|error| raise(components.py(), &error.into()))
}

fn to_array<'py>(py: Python<'py>, atoms: &Atoms) -> PyResult<Bound<'py, PyArray2<f32>>> {
    PyArray1::from_slice(py, atoms.as_slice()).reshape([atoms.len(), atoms.dim()])
}

/// Learns atoms. Returns the atoms, the number of rounds, the number of rows learned from, and the mean number of
/// nonzeros of held-out rows.
#[pyfunction]
#[pyo3(signature = (rows, *, atoms, rule, seed, sample, progress))]
pub(crate) fn learn_rows<'py>(
    py: Python<'py>,
    rows: Rows<'py>,
    atoms: Option<usize>,
    rule: Rule,
    seed: u64,
    sample: usize,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyArray2<f32>>, usize, usize, f64)> {
    let options = move || -> Result<LearnOptions> {
        Ok(LearnOptions::new(rule.stop()?)
            .with_atoms(atoms)
            .with_pursuit(rule.pursuit()?)
            .with_seed(seed)
            .with_sample(sample)
            .with_momentum(DEFAULT_MOMENTUM))
    };
    let learned = for_rows!(rows, rows => {
        let (dim, rows) = copied(&rows);
        without_gil(py, progress, move |watch| Ok(learn_atoms(dim, &rows, &options()?, watch)?))?
    });
    Ok((to_array(py, &learned.atoms)?, learned.rounds, learned.sample, learned.held_out_nonzeros))
}

/// Codes rows over atoms. Returns the arrays of a CSR matrix.
#[pyfunction]
#[pyo3(signature = (components, rows, *, rule, progress))]
pub(crate) fn encode_rows<'py>(
    py: Python<'py>,
    components: PyReadonlyArray2<'py, f32>,
    rows: Rows<'py>,
    rule: Rule,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Codes<'py>> {
    let atoms = atoms_of(&components)?;
    for_rows!(rows, rows => {
        let (dim, rows) = copied(&rows);
        check_length(py, &atoms, dim)?;
        let coded = without_gil(py, progress, move |watch| Ok(encode_all(&rule.coder(&atoms)?, &rows, watch)?))?;
        to_arrays(py, coded)
    })
}

fn to_arrays<V: RowValue + Element>(py: Python<'_>, codes: RowCodes<V>) -> PyResult<Codes<'_>> {
    Ok((
        PyArray1::from_vec(py, numbers(py, codes.starts)?),
        PyArray1::from_vec(py, codes.atoms.into_iter().map(i32::from).collect()),
        PyArray1::from_vec(py, codes.values).into_any(),
        PyArray1::from_vec(py, codes.errors),
        PyArray1::from_vec(py, numbers(py, codes.escapes)?),
    ))
}

fn numbers(py: Python<'_>, counts: Vec<usize>) -> PyResult<Vec<i64>> {
    let converted = counts.into_iter().map(i64::try_from).collect::<std::result::Result<_, _>>();
    converted.map_err(|_| parameter(py, "rows", "too many", "fewer than 2^63 nonzeros"))
}

fn check_length(py: Python<'_>, atoms: &Atoms, dim: usize) -> PyResult<()> {
    if atoms.dim() == dim {
        return Ok(());
    }
    Err(parameter(py, "rows", format!("{dim} values each"), format!("{}, as the atoms have", atoms.dim())))
}

/// Sums over coded rows, from which atoms are refitted.
#[pyclass(frozen, module = "lexisplat._native")]
#[derive(Debug)]
pub(crate) struct Statistics(Sums);

#[pymethods]
impl Statistics {
    /// Codes rows and sums the statistics that learning needs.
    #[staticmethod]
    #[pyo3(signature = (components, rows, *, rule, progress))]
    fn of<'py>(
        py: Python<'py>,
        components: PyReadonlyArray2<'py, f32>,
        rows: Rows<'py>,
        rule: Rule,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let atoms = atoms_of(&components)?;
        for_rows!(rows, rows => {
            let (dim, rows) = copied(&rows);
            check_length(py, &atoms, dim)?;
            without_gil(py, progress, move |watch| Ok(Self(Sums::of(&rule.coder(&atoms)?, &rows, watch)?)))
        })
    }

    /// Returns the sums of both.
    fn plus(&self, py: Python<'_>, other: &Self) -> PyResult<Self> {
        let mut sum = self.0.clone();
        sum.add(&other.0).map_err(|error| raise(py, &error.into()))?;
        Ok(Self(sum))
    }

    /// Returns all sums times a factor from 0 to 1.
    fn scaled(&self, py: Python<'_>, factor: f64) -> PyResult<Self> {
        self.0.clone().scaled(factor).map(Self).map_err(|error| raise(py, &error.into()))
    }

    /// Returns atoms that fit the sums better than `components`.
    fn update<'py>(
        &self,
        py: Python<'py>,
        components: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let atoms = atoms_of(&components)?;
        let sums = &self.0;
        let updated = without_gil(py, None, move |_| Ok(sums.update(&atoms)?))?;
        to_array(py, &updated)
    }

    #[getter]
    fn rows(&self) -> f64 {
        self.0.rows()
    }

    #[getter]
    fn nonzeros(&self) -> f64 {
        self.0.nonzeros()
    }

    #[getter]
    fn squared_error(&self) -> f64 {
        self.0.squared_error()
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.0.to_bytes())
    }

    #[staticmethod]
    fn from_bytes(py: Python<'_>, bytes: &[u8]) -> PyResult<Self> {
        Sums::from_bytes(bytes).map(Self).map_err(|error| raise(py, &error.into()))
    }
}
