//! A picture of a robot.

use crate::failure::Failure;
use crate::robot::Robot;
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3};
use page::film::Picture;
use pyo3::prelude::*;

/// Draws a robot with yaw, pitch and roll in degrees, and with the centre lines of both flagella, body axes, m, shape (2, nodes,
/// 3), or with the lines at rest. Returns red, green and blue, shape (height, width, 3).
#[pyfunction]
pub fn picture<'py>(
    py: Python<'py>,
    robot: &Robot,
    angles_deg: [f64; 3],
    shapes: Option<PyReadonlyArray3<'py, f64>>,
    width: u16,
) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let wrong = |reason: &str| Failure::parameter("shapes", reason);
    let lines = match &shapes {
        Some(shapes) => {
            let shapes = shapes.as_array();
            let [2, nodes, 3] = *shapes.shape() else {
                return Err(wrong("give an array of shape (2, nodes, 3)").into());
            };
            if nodes < 2 {
                return Err(wrong("give two nodes or more").into());
            }
            let node = |k: usize, i: usize| [0, 1, 2].map(|axis| shapes[[k, i, axis]]);
            Some([0, 1].map(|k| (0..nodes).map(|i| node(k, i)).collect::<Vec<_>>()))
        }
        None => None,
    };
    let picture = Picture::new(robot.params.clone(), width);
    let [width, height] = picture.size;
    let pixels = py.detach(|| picture.rgb(angles_deg, lines));
    let image = Array3::from_shape_vec((height, width, 3), pixels).map_err(|error| wrong(&error.to_string()))?;
    Ok(image.into_pyarray(py))
}
