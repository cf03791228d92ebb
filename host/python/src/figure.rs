//! The program's figures for a paper.

use crate::failure::Failure;
use crate::interrupt::interruptible;
use crate::simulate::Simulated;
use page::figure::{self, COLUMN_MM, Format, Lines, MOMENTS, Subject, WIDTHS_MM};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::ffi::CString;
use std::path::{Path, PathBuf};

/// A figure of the program `biflag`, which a notebook shows.
#[pyclass(frozen, module = "biflag")]
pub struct Figure {
    figure: figure::Figure,
    /// The figure as text.
    #[pyo3(get)]
    svg: String,
}

/// Draws a figure for a paper, as `biflag figure` with the same subject and options. Each source is a path, an object read from a
/// path, or a simulated trial.
#[pyfunction(name = "figure")]
#[pyo3(signature = (subject, *sources, width_mm=None, **options))]
pub fn draw(
    py: Python<'_>,
    subject: &str,
    sources: Vec<Bound<'_, PyAny>>,
    width_mm: Option<f64>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Figure> {
    let wrong = |key: &str, reason: String| Err(Failure::parameter(key, reason).into());
    let takes: &[&str] = match subject {
        "trial" => &["number", "time", "against", "anyway"],
        "forces" | "contact" => &["number", "time"],
        "strip" => &["number", "time", "moments"],
        "lines" => &["value", "over", "by", "at"],
        "map" => &["against", "anyway", "at"],
        "scatter" => &["against", "anyway"],
        "fit" => &[],
        _ => return wrong("subject", format!("\"{subject}\" is none; `biflag figure --help` lists them")),
    };
    let options = options.map_or_else(|| Ok(PyDict::new(py)), |options| options.copy())?;
    for name in options.keys().extract::<Vec<String>>()? {
        if !takes.contains(&&*name) {
            return wrong(&name, format!("is no option of the figure \"{subject}\", which has {}", takes.join(", ")));
        }
    }
    let folder = tempfile::tempdir()?;
    let paths: Vec<_> = sources.iter().map(|one| path_of(one, folder.path())).collect::<PyResult<_>>()?;
    let against = given(&options, "against")?.map(|one| path_of(&one, &folder.path().join("against"))).transpose()?;
    if paths.is_empty() || (paths.len() > 1 && subject != "fit") || (subject == "scatter" && against.is_none()) {
        return wrong("sources", "give one, several with \"fit\", and `against` with \"scatter\"".to_owned());
    }
    let (number, time) = (get(&options, "number")?, get(&options, "time")?);
    let (moments, anyway): (u16, bool) =
        (get(&options, "moments")?.unwrap_or(6), get(&options, "anyway")?.unwrap_or(false));
    let width_mm = width_mm.unwrap_or(COLUMN_MM);
    if !WIDTHS_MM.contains(&width_mm) || !MOMENTS.contains(&i64::from(moments)) {
        let possible = format!("give {WIDTHS_MM:?} mm, and {MOMENTS:?} moments");
        return wrong("width_mm, moments", possible.replace("..=", " to "));
    }
    let [value, over, by] = ["value", "over", "by"].map(|name| get::<String>(&options, name));
    let (value, over, by) = (value?, over?, by?);
    let at: BTreeMap<String, f64> = get(&options, "at")?.unwrap_or_default();
    let at: Vec<_> = at.into_iter().collect();
    let mut figure = interruptible(py, |_| {
        let (path, against) = (&*paths[0], against.as_deref());
        let trial = Subject { path, number };
        let figure = match subject {
            "trial" => figure::trial(trial, against, anyway, time, width_mm),
            "forces" => figure::forces(trial, time, width_mm),
            "contact" => figure::contact(trial, time, width_mm),
            "strip" => figure::strip(trial, time, moments.into(), width_mm),
            "lines" => {
                let (value, over) = (value.as_deref().unwrap_or("yaw_deg"), over.as_deref().unwrap_or("w1_rpm"));
                figure::lines(path, Lines { value, over, by: by.as_deref(), at: &at }, width_mm)
            }
            "map" => figure::map(path, against, anyway, &at, width_mm),
            "fit" => figure::fit(&paths, width_mm),
            _ => figure::scatter(path, against.unwrap_or(path), anyway, width_mm),
        };
        figure.map_err(|error| Failure::of(&error))
    })?;
    figure.rename_logs(&folder.path().display().to_string(), "unsaved");
    let grave = figure.remarks.findings.iter().filter(|of_log| of_log.finding.grave);
    let grave = grave.map(|of_log| format!("{}: {}", of_log.log, of_log.finding));
    for text in grave.chain(figure.remarks.warnings.iter().cloned()) {
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &CString::new(text.replace('\0', ""))?, 1)?;
    }
    let svg = figure.content(Format::Svg).map_err(|error| Failure::of(&error))?;
    Ok(Figure { svg: String::from_utf8_lossy(&svg).into_owned(), figure })
}

/// Returns the path of a source; a trial without a path is written into `folder`.
fn path_of(source: &Bound<'_, PyAny>, folder: &Path) -> PyResult<PathBuf> {
    if let Ok(trial) = source.getattr("_simulated") {
        std::fs::create_dir_all(folder)?;
        return Ok(trial.cast::<Simulated>()?.get().write_into(folder)?);
    }
    source.getattr("path").as_ref().unwrap_or(source).extract()
}

fn given<'py>(options: &Bound<'py, PyDict>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
    Ok(options.get_item(name)?.filter(|value| !value.is_none()))
}

fn get<'py, T: FromPyObjectOwned<'py>>(options: &Bound<'py, PyDict>, name: &str) -> PyResult<Option<T>> {
    given(options, name)?.map(|value| value.extract().map_err(Into::into)).transpose()
}

#[pymethods]
impl Figure {
    /// Writes the figure as .svg, .pdf or .png.
    fn save(&self, path: PathBuf) -> Result<(), Failure> {
        self.figure.write(&path).map_err(|error| Failure::of_file(&path, &error))
    }

    /// Returns the figure for a notebook, without the command line of the notebook.
    fn _repr_svg_(&self) -> String {
        let cut = self.svg.split_once("<desc>").and_then(|(head, rest)| Some((head, rest.split_once("</desc>")?.1)));
        cut.map_or_else(|| self.svg.clone(), |(head, tail)| format!("{head}{tail}"))
    }
}
