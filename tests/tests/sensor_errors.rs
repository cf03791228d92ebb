//! Each error of the sensor alone, at half of the limit of its data sheet: it adds to the angles what its derivative says.

use biflag_log::MeasuredSensorMeta;
use host::plan::Phases;
use host::trial::{CommonTo, Judged};
use sim::params::Robot;
use tests::synthetic_rig::{Motion, Part, Random, Rig, Start, each, known_but_for};

/// A fast turn that leans: everything matters.
const RPM: [f64; 2] = [-83.1, 27.7];

/// The errors with half of their limits (PS-MPU-6000A revision 3.4, sections 6.1 and 6.2), and of a mounting by eye. At the whole
/// limit, what is of the second order in a mounting is half of what is of the first.
fn errors() -> Vec<(&'static str, String, f64)> {
    let axes = ["x", "y", "z"];
    let mut all = Vec::new();
    for i in axes {
        for (table, size) in [("gyro_scale", 0.015), ("accel_scale", 0.015), ("mounting_deg", 1.0)] {
            all.push((table, i.to_owned(), size));
        }
        for j in axes {
            all.push(("gyro_g_dps", format!("{i}{j}"), 0.05));
            if i != j {
                all.extend(["gyro_cross", "accel_cross"].map(|table| (table, format!("{i}{j}"), 0.01)));
            }
        }
    }
    all
}

/// Returns yaw, pitch and roll of a trial with a part of which something is known, and what the sensor is to them by the
/// budget.
fn angles(motion: &Motion, part: &Part, known: MeasuredSensorMeta, phases: &Phases) -> ([f64; 3], [f64; 3]) {
    let rig = Rig { part: part.clone(), measured: Some(known), phases: *phases, start: Start::AtRest };
    let zeroed = Judged::of(rig.record(motion, &mut Random(77)).data).angles;
    let steady = zeroed.steady.expect("a run");
    let u_deg = |k: usize| steady.budgets[k].as_ref().expect("a rest").common_to(CommonTo::Sensor).u_deg();
    (steady.angles_deg, [0, 1, 2].map(u_deg))
}

/// The noise is that of the trial without the error, so that differences have none.
#[test]
fn each_error_adds_what_its_derivative_says() {
    let begun = std::time::Instant::now();
    let phases = Phases { run_s: 30.0, decay_s: 10.0, ..Phases::default() };
    let motion = Motion::of(&Robot::default(), RPM, phases.run_s);
    let (errors, nothing) = (errors(), || known_but_for("gyro_scale", "x", 0.0, 0.0));
    let ideal = Part::with("gyro_scale", "x", 0.0);
    let (exact, _) = angles(&motion, &ideal, nothing(), &phases);
    let rows = each(errors.len(), |i| {
        let (table, key, size) = &errors[i];
        let part = Part::with(table, key, *size);
        let (off, _) = angles(&motion, &part, nothing(), &phases);
        let (corrected, _) = angles(&motion, &part, known_but_for(table, key, *size, 0.0), &phases);
        let (_, stated) = angles(&motion, &ideal, known_but_for(table, key, 0.0, *size), &phases);
        [0, 1, 2].map(|k| [off[k] - exact[k], corrected[k] - exact[k], stated[k]])
    });
    let mut wrong = Vec::new();
    for ((table, key, size), row) in errors.iter().zip(&rows) {
        println!("{table}.{key} {size}: {row:.3?}");
        for (angle, [off, left, stated]) in ["yaw", "pitch", "roll"].into_iter().zip(row) {
            // Of the second order in the errors, and the noise of the filter.
            let allowed = 0.05 * off.abs() + 0.02;
            if left.abs() > allowed || (off.abs() - stated).abs() > allowed {
                wrong.push(format!("{table}.{key}, {angle}: off by {off:.3}, corrected {left:.3}, stated {stated:.3}"));
            }
        }
    }
    println!("{:.1} s", begun.elapsed().as_secs_f64());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
